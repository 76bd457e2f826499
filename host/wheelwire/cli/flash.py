"""`wheelwire flash`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from wheelwire.errors import FlashFailed

from .output import JsonFlag, console, print_json

PortOption = Annotated[
    str | None, typer.Option(help="The board's port; without it, the only one that may be one.")
]
ImageOption = Annotated[
    Path | None, typer.Option(help="A release's image; without it, this checkout's build.")
]


def flash(
    port: PortOption = None,
    image: ImageOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Write the firmware to a board, and shake hands with it."""
    from wheelwire import flash as flasher  # here, so that other commands start without it

    wanted = flasher.read_image(image) if image else None
    port = port or flasher.only_likely_port()
    flasher.ensure_stopped(port)
    board = flasher.identify_chip(port)
    chosen = wanted or flasher.built_image(board)
    if chosen.board is not board:
        raise FlashFailed(
            f"{chosen.path} is for the {chosen.board.name}, the chip at {port} is an {board.name}"
        )
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(f"writing {chosen.path.name}", total=1.0)
        flasher.write_image(port, chosen, lambda part: progress.update(task, completed=part))
    device = flasher.verify(port, chosen)
    if as_json:
        print_json({"port": port, "image": str(chosen.path), "device": device})
    else:
        console.print(
            f"{device.board.name} {device.board_id} at {port} runs firmware {device.release}"
        )
