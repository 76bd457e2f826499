"""`wheelwire why`: why the robot stopped, in plain words, with the evidence; black boxes, re-run.

It imports `wheelwire.log.why` only when needed, so that other commands start without it.
"""

from __future__ import annotations

import shlex
import time
import zlib
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wheelwire.connect import is_recording
from wheelwire.errors import DriverUnavailable, InvalidArgument, OutputFailed, RecordingError
from wheelwire.link.clock import host_clock_us
from wheelwire.whole_file import write_whole
from wheelwire_protocol.black_box import BoxError, Rerun, RerunOutcome
from wheelwire_protocol.codes import StopCause

from .address import Address, Given
from .log import draw_recording
from .output import print_json, print_lines, printed_json, wants_json, write_new
from .registry import Heading, command

if TYPE_CHECKING:
    from wheelwire.log.why.diagnosis import Stop

    from ..robot.black_boxes import Recorded


BEFORE_S, AFTER_S = 4.0, 1.0
"""The time around the newest stop that the picture shows."""
NOTHING = "Nothing has stopped the robot in this file."
SUFFIX = ".box"
DIFFERENT = 31
"""Exit code if the core did something else than the box says."""
BOXES = Path("tests", "firmware", "boxes")
TEST = Path("tests", "firmware", "test_boxes.py")
"""Both in a checkout."""


@command("why", Heading.LOOK, 4, page="why")
def why(
    given: Given,
    plot: Annotated[Path | None, typer.Option(metavar="PNG")] = None,
    rerun: Annotated[Path | None, typer.Option(metavar="FILE", show_default=False)] = None,
    export_test: bool = False,
    save_boxes: Annotated[Path | None, typer.Option(metavar="FOLDER", show_default=False)] = None,
) -> None:
    """Explain why the robot stopped, from a recording FILE.mcap, a black box FILE.box, or a ROBOT.

    From a ROBOT it reads the recorded stops, and what holds it now. It names a cause, what shows
    it, and what to look at first; where the data cannot decide, all causes left. With --rerun it
    runs the inputs in a black box again.

    Args:
        given: The robot.
        plot: Draw the seconds around a recording's newest stop.
        rerun: Run a black box's inputs through the same core; exit code 31 if it differs.
        export_test: With --rerun: write the box as a regression test to PATH, given in place of
            ROBOT: a file, a folder, or a checkout; default: this checkout.
        save_boxes: Write the ROBOT's black boxes into this folder, for `wheelwire why FILE.box`.
    """
    if rerun is not None:
        if plot is not None:
            raise InvalidArgument("--plot draws a recording, not a black box: leave it out")
        rerun_file(rerun, given.robot, export=export_test)
        return
    if export_test:
        raise InvalidArgument("--export-test needs a black box: --rerun FILE --export-test")
    address = given.resolve()
    _check_options(address.text, plot, save_boxes)
    facts: list[str] = []
    if is_recording(address.text):
        said, facts = _of_recording(Path(address.text), plot)
    elif is_box(address.text):
        said = [_said(stop, None) for stop in stops_of_file(Path(address.text))]
        facts = [] if said else [NOTHING]
    else:
        said, facts = _of_robot(address, save_boxes)
    if not printed_json(said):
        _print(said, facts)


def _check_options(address: str, plot: Path | None, folder: Path | None) -> None:
    if plot is not None and not is_recording(address):
        raise InvalidArgument(f"--plot draws a recording: name FILE.mcap instead of {address}")
    if folder is None:
        return
    if is_recording(address) or is_box(address):
        raise InvalidArgument(f"--save-boxes reads a robot: name one instead of {address}")
    with OutputFailed.of(folder):
        folder.mkdir(parents=True, exist_ok=True)  # before anything is read


def _of_recording(file: Path, plot: Path | None) -> tuple[list[dict[str, Any]], list[str]]:
    """What stopped the robot, and what was latched before, if that is all."""
    from wheelwire.log import reader
    from wheelwire.log.why.diagnosis import Diagnosis

    diagnosis = Diagnosis()
    with reader.damage_of(file):
        stops = diagnosis.feed_all(reader.session_records(file))
        stops += diagnosis.end(complete=not reader.was_cut(file))
    if not stops and not diagnosis.has_heard:
        reader.check_cut_off(file)
        raise RecordingError(
            f"{file}: the robot was out of reach all the time, so the recording cannot tell "
            "whether something stopped it: `wheelwire why ROBOT` asks the robot itself"
        )
    said = reader.metadata(file)
    added_us = reader.offset_us(file)
    if plot is not None:
        if not stops:
            raise InvalidArgument(
                f"{file}: nothing has stopped the robot: there is nothing to draw"
            )
        at_us = stops[-1].host_us
        window_us = at_us - BEFORE_S * 1e6, at_us + AFTER_S * 1e6
        draw_recording(file, plot, stops[-1].sentence, window_us)
    facts = [] if stops else [NOTHING]
    if facts and diagnosis.latched_before:
        before = ", ".join(diagnosis.latched_before)
        facts.append(f"It was stopped before the recording began: {before}.")
    if reader.is_being_written(file):
        facts.append("It is being recorded: what comes is not in this yet.")
    elif ended := said.get(reader.ENDED):
        facts.append(
            f"The recorder gave up before the robot was closed ({ended}): what came later is not "
            "in the file."
        )
    return [_said(stop, stop.host_us + added_us) for stop in stops], facts


def _of_robot(address: Address, folder: Path | None) -> tuple[list[dict[str, Any]], list[str]]:
    """What stopped the robot, and other facts that are worth a line."""
    from wheelwire.log.why.device import ledger_facts, stops_of_device

    with address.open_to_look() as driver:
        if not driver.has_device:
            raise DriverUnavailable(
                f"the driver of {address.text} reports no stops: name another robot"
            )
        recorded = driver.recorder.read()
        sample, device, holding = driver.read(), driver.info.device, driver.holding()
    found = stops_of_device(device, sample, recorded, holding)
    if recorded.why_none and folder is not None:
        raise RecordingError(recorded.why_none)
    facts = [f"held by: {', '.join(holding.held_by.names)}"]
    if not holding.held_by:
        facts = [f"Nothing holds the robot: it is {sample.state.name}."]
    if holding.last_stop.cause is StopCause.UNKNOWN:
        facts.append(str(holding.last_stop))
    if recorded.why_none:
        facts.append(f"What it has recorded is not in this: {recorded.why_none}.")
    if recorded.ledger is not None:
        facts += [f"{name}: {text}" for name, text in ledger_facts(recorded.ledger).items()]
    if folder is not None:
        facts += [f"Written: {file}" for file in write_boxes(recorded, device.board_id, folder)]
    to_unix_us = time.time_ns() // 1000 - host_clock_us()
    said = [
        _said(one.stop, one.stop.host_us + to_unix_us if one.is_dated else None) for one in found
    ]
    return said, facts


def _said(stop: Stop, unix_us: int | None) -> dict[str, Any]:
    time = None if unix_us is None else datetime.fromtimestamp(unix_us / 1e6).astimezone()
    return {
        "time": None if time is None else time.isoformat(timespec="milliseconds"),
        "cause": stop.cause,
        "sentence": stop.sentence,
        "evidence": list(stop.evidence),
        "look_at": stop.look_at,
    }


def _print(said: list[dict[str, Any]], facts: list[str]) -> None:
    for stop in said:
        when = "" if stop["time"] is None else f"{datetime.fromisoformat(stop['time']):%H:%M:%S.%f}"
        print_lines(f"{when[:-3]}  {stop['sentence']}".strip(), style="bold")
        print_lines(*(f"    {evidence}" for evidence in stop["evidence"]))
        if stop["look_at"]:
            print_lines(f"    Look first at {stop['look_at']}.", style="cyan")
    print_lines(*filter(None, facts))


def rerun_file(file: Path, place: str | None, *, export: bool) -> None:
    """Re-run a box, report the result, and export it.

    Raises:
        InvalidArgument: There is nowhere to write the test.
        OutputFailed: The test cannot be written, or exists already.
        RecordingError: This core cannot re-run the file as a box.
        typer.Exit: The core did something else.
    """
    from wheelwire.log.why.black_box import read_box, rerun_box

    if is_recording(file.name):
        raise InvalidArgument(
            f"{file} is a recording: run `wheelwire why {file}`; --rerun takes a black box"
        )
    if place is not None and not export:
        raise InvalidArgument(f"--rerun takes a black box and has no use for {place}: leave it out")
    target = _test_target(file, place) if export else None
    head, found = read_box(file).head, rerun_box(file)
    same = found.outcome is RerunOutcome.SAME
    command = None
    if target is not None:
        _write_test(target, file.read_bytes())
        command = _test_command(target)
    if wants_json():
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


def _test_target(file: Path, place: str | None) -> Path:
    """The file to write a test to."""
    path = Path.cwd() if place is None else Path(place)
    if place is not None and not path.is_dir():
        if path.suffix != ".box":
            raise InvalidArgument(f"{path}: name a folder that exists, or a file NAME.box")
        return path
    for folder in (path, *path.resolve().parents) if place is None else (path,):
        if (folder / TEST).is_file():
            return folder / BOXES / _test_name(file)
    if place is None:
        raise InvalidArgument(
            "no checkout of Wheelwire here: run it within one, or say --export-test PATH"
        )
    return path / _test_name(file)


def _test_name(file: Path) -> str:
    # By content: one box has one name.
    try:
        return f"{file.stem}-{zlib.crc32(file.read_bytes()):08x}.box"
    except OSError:
        return file.name  # reading it as a box says what is wrong


def _write_test(target: Path, image: bytes) -> None:
    with OutputFailed.of(target):
        try:
            if target.parent.name == BOXES.name:
                target.parent.mkdir(exist_ok=True)
            write_new(target, image)
        except FileExistsError:
            if target.is_file() and target.read_bytes() == image:
                has = f"has this box already: run {_test_command(target)}"
                raise OutputFailed(f"{target} {has}") from None
            raise OutputFailed(f"{target} exists and is another one: choose another name") from None


def _test_command(target: Path) -> str:
    root = target.resolve().parents[len(BOXES.parts)]
    if target.resolve() == root / BOXES / target.name and (root / TEST).is_file():
        test = f"{TEST}::test_a_box_is_done_again[{target.stem}]"
        return f"cd {shlex.quote(str(root))} && python -m pytest {shlex.quote(test)}"
    return f"wheelwire why --rerun {shlex.quote(str(target))}"


def is_box(address: str) -> bool:
    """Whether an address is a file of a black box."""
    return address.lower().endswith(SUFFIX)


def stops_of_file(file: Path) -> list[Stop]:
    """The stops that a box recorded.

    Raises:
        RecordingError: It cannot be read, or is not a black box.
    """
    from wheelwire.log.why.black_box import read_box, stops_of_box

    try:
        return stops_of_box(read_box(file))
    except BoxError as error:
        raise RecordingError(f"{file} is {error}: use the library of that release") from error


def write_boxes(recorded: Recorded, board_id: str, folder: Path) -> list[Path]:
    """Write each box that was read to a file of its own; a file that exists holds the same box.

    Raises:
        OutputFailed: One cannot be written.
    """
    written = []
    for box, image in recorded.boxes:
        head = box.head
        name = f"{board_id}-{head.number}-{head.boot_id:08x}-{head.cause.name.lower()}{SUFFIX}"
        if image:
            written.append(_write_box(folder / name, image))
    return written


def _write_box(file: Path, image: bytes) -> Path:
    with OutputFailed.of(file):
        write_whole(file, image)
    return file
