"""`wheelwire why --rerun`: a black box's inputs through the same core again, and as a test."""

from __future__ import annotations

import shlex
import zlib
from pathlib import Path

import typer

from wheelwire.connect import is_recording
from wheelwire.errors import InvalidArgument, OutputFailed
from wheelwire_protocol.black_box import Rerun, RerunOutcome

from .output import print_json, print_lines, write_new

DIFFERENT = 31
"""Exit code if the core did something else than the box says."""
BOXES = Path("tests", "firmware", "boxes")
TEST = Path("tests", "firmware", "test_boxes.py")
"""Both in a checkout."""


def rerun_file(file: Path, place: str | None, *, export: bool, as_json: bool) -> None:
    """Re-run a box, say what came of it, and export it.

    Raises:
        InvalidArgument: There is no place for the test.
        OutputFailed: The test cannot be written, or is there already.
        RecordingError: The file is no box that this core can re-run.
        typer.Exit: The core did something else.
    """
    from wheelwire.log.black_box import read_box, rerun_box

    if is_recording(file.name):
        raise InvalidArgument(
            f"{file} is a recording: run `wheelwire why {file}`; --rerun takes a black box"
        )
    if place is not None and not export:
        raise InvalidArgument(f"--rerun takes a black box and has no use for {place}: leave it out")
    target = _target(file, place) if export else None
    head, found = read_box(file).head, rerun_box(file)
    same = found.outcome is RerunOutcome.SAME
    command = None
    if target is not None:
        _write(target, file.read_bytes())
        command = _command(target)
    if as_json:
        keys = ("step", "t_us", "field", "recorded", "computed")
        difference = None if same else {key: getattr(found, key) for key in keys}
        print_json(
            {
                "same": same,
                "steps": found.steps,
                "seconds": _seconds(found),
                "cause": head.cause,
                "release": head.release,
                "core": f"{head.core:08x}",
                "difference": difference,
                "test": None if target is None else str(target),
                "command": command,
            }
        )
    else:
        print_lines(_sentence(found, same=same), style="bold")
        if target is not None:
            print_lines(f"Written to {target}. Run it by")
            print_lines(f"    {command}", style="cyan")
    if not same:
        raise typer.Exit(DIFFERENT)


def _seconds(found: Rerun) -> float:
    return (found.last_us - found.first_us) / 1e6


def _sentence(found: Rerun, *, same: bool) -> str:
    if same:
        return (
            f"Identical, bit by bit: duties, transitions and state of {found.steps} steps, "
            f"{_seconds(found):.2f} s."
        )
    where = f"Different in step {found.step}, at {found.t_us / 1e6:.6f} s of the device's clock"
    if found.field == "record":
        return f"{where}: the core did not do what the box says next, or did more."
    return f"{where}: {found.field} is {found.computed:g}, and was {found.recorded:g}."


def _target(file: Path, place: str | None) -> Path:
    """The file to write a test to."""
    path = Path.cwd() if place is None else Path(place)
    if place is not None and not path.is_dir():
        if path.suffix != ".box":
            raise InvalidArgument(f"{path}: name a folder that exists, or a file NAME.box")
        return path
    for folder in (path, *path.resolve().parents) if place is None else (path,):
        if (folder / TEST).is_file():
            return folder / BOXES / _name(file)
    if place is None:
        raise InvalidArgument(
            "no checkout of Wheelwire here: run it within one, or say --export-test PATH"
        )
    return path / _name(file)


def _name(file: Path) -> str:
    # By content: one box has one name.
    try:
        return f"{file.stem}-{zlib.crc32(file.read_bytes()):08x}.box"
    except OSError:
        return file.name  # reading it as a box says what is wrong


def _write(target: Path, image: bytes) -> None:
    try:
        if target.parent.name == BOXES.name:
            target.parent.mkdir(exist_ok=True)
        write_new(target, image)
    except FileExistsError:
        if target.is_file() and target.read_bytes() == image:
            raise OutputFailed(f"{target} has this box already: run {_command(target)}") from None
        raise OutputFailed(f"{target} exists and is another one: choose another name") from None
    except OSError as error:
        raise OutputFailed.at(target, error) from error


def _command(target: Path) -> str:
    root = target.resolve().parents[len(BOXES.parts)]
    if target.resolve() == root / BOXES / target.name and (root / TEST).is_file():
        test = f"{TEST}::test_a_box_is_done_again[{target.stem}]"
        return f"cd {shlex.quote(str(root))} && python -m pytest {shlex.quote(test)}"
    return f"wheelwire why --rerun {shlex.quote(str(target))}"
