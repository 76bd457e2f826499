"""`wheelwire flash`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import Progress

from wheelwire.connect import is_robot_file
from wheelwire.errors import FlashFailed, InvalidArgument

from .address import Given, RobotArgument
from .output import console, error_console, print_json, print_lines, wants_json
from .registry import Heading, command

if TYPE_CHECKING:
    from wheelwire.tools.flash import Plan


@command("flash", Heading.BUILD, 3, page="tutorial/4-flash")
def flash(
    robot: RobotArgument = None,
    port: Annotated[str | None, typer.Option(hidden=True)] = None,
    image: Path | None = None,
    board: str | None = None,
    erase: bool = False,
) -> None:
    """Write the firmware to a board and connect to it. Saved parameters stay.

    Args:
        robot: Where the board is plugged in.
        port: The same as ROBOT.
        image: Image from a release; default: this checkout's build.
        board: A board's file or name, stored once the firmware runs.
        erase: Erase the whole flash first, saved parameters included.
    """
    from wheelwire.connect import open_driver
    from wheelwire.robot.robot import opened_to_look
    from wheelwire.tools import flash as flasher  # here, so that other commands start faster
    from wheelwire.tools.files.board import checked_board

    if robot and (robot.endswith(".bin") or (Path(robot).is_file() and not is_robot_file(robot))):
        raise InvalidArgument(
            f"{robot} is an image, not a ROBOT: `wheelwire flash [ROBOT] --image {robot}`"
        )
    # What can be wrong without the chip is found before it is touched.
    wanted = flasher.read_image(image) if image else None
    pins = checked_board(board) if board else None
    port = Given(port if robot is None else robot).resolve().serial_port()
    # First: the next steps reset the chip, and its wheels would roll on.
    flasher.ensure_stopped(port)
    chip = flasher.identify_chip(port)
    chosen = wanted or flasher.built_image(chip)
    if chosen.chip is not chip:
        raise FlashFailed(
            f"{chosen.path} is for the {chosen.chip.name}, but the chip at {port} is an "
            f"{chip.name}: use --image with the release's wheelwire-{chip.name.lower()}.bin"
        )
    if pins is not None and pins.chip is not chip:
        raise FlashFailed(
            f"{board} is for the {pins.chip.name}, but the chip at {port} is an {chip.name}: "
            "choose a board for this chip (`wheelwire board list`)"
        )
    plan = flasher.plan_flash(chosen, flasher.read_chip_table(port, chip), erase_all=erase)
    if not wants_json():
        print_lines(*_describe(plan))
    # On standard error: standard output may be JSON.
    hidden = not error_console.is_terminal
    with Progress(console=error_console, transient=True, disable=hidden) as progress:
        task = progress.add_task(f"writing {chosen.path.name}", total=1.0)
        flasher.write_plan(port, chip, plan, lambda part: progress.update(task, completed=part))
    device = flasher.verify(port, chip)
    # Only a firmware that runs can store a board.
    if pins is not None:
        with opened_to_look(), open_driver("serial", port=port) as driver:
            driver.board.take_up(pins)
    if wants_json():
        erased = [{"name": p.name, "offset": p.offset, "size": len(p.content)} for p in plan.erased]
        print_json(
            {
                "port": port,
                "image": str(chosen.path),
                "kept": plan.kept,
                "erased": erased,
                "erased_all": plan.erase_all,
                "device": device,
                "board": pins.name if pins else None,
            }
        )
    else:
        console.print(
            f"{device.board.name} {device.board_id} at {port} runs firmware {device.release}"
        )
        if pins is not None:
            print_lines(f"{pins.name}: written, tried and saved")


def _describe(plan: Plan) -> list[str]:
    """The plan in sentences, for a person to read before anything is written."""
    if plan.erase_all:
        return ["erases the whole flash, saved parameters included"]
    kept = ", ".join(plan.kept) or "nothing"
    lines = [f"keeps the data in: {kept}"]
    if plan.erased:
        regions = ", ".join(f"{p.name} {p.offset:#x} to {p.end:#x}" for p in plan.erased)
        lines.append(f"erases {regions}: {plan.reason}")
    return lines
