"""`wheelwire log`: record a robot's day; look at, decode, draw and repair what was recorded.

What the commands need of `wheelwire.log` they import themselves: all others start without it.
"""

from __future__ import annotations

import csv
import logging
import math
import struct
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wheelwire import errors
from wheelwire.connect import is_recording
from wheelwire.drivers.attached import AttachedDriver
from wheelwire.robot.robot import Robot
from wheelwire_protocol.codec import BY_ID

from .address import Given
from .interruptions import Interrupted, ended_by_signals, watch
from .output import (
    check_writable,
    console,
    print_facts,
    print_json,
    print_lines,
    print_note,
    print_result,
    printed_json,
    show_help_alone,
    to_json_value,
    wants_json,
)
from .parameters import RobotCommand, robot_and
from .registry import Commands, Heading, command
from .sensors import ask_for_samples

if TYPE_CHECKING:
    from wheelwire.log.recorder import Recorder
    from wheelwire.log.rerun import Frame
    from wheelwire.log.summary import Summary

LOOK_S = 0.1
"""Time between two looks at the robot while the link records it."""
_F32 = struct.Struct("f")
MESSAGES = {codec.type.__name__: codec.type for codec in BY_ID.values()}

app = Commands()
command("log", Heading.LOOK, 6, page="recording")(app)


def _complete(incomplete: str) -> Iterator[tuple[str, str]]:
    """The recordings in the folder of what was typed."""
    folder = Path(incomplete if incomplete.endswith("/") else Path(incomplete).parent)
    for path in sorted(folder.glob("*.mcap")):
        yield str(path), "a recording"


FileArgument = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="A recording, FILE.mcap.", show_default=False, autocompletion=_complete
    ),
]


@app.callback(invoke_without_command=True)
def log(context: typer.Context) -> None:
    """Record a robot's day, and look at what was recorded."""
    show_help_alone(context)


@app.command("record", cls=RobotCommand)
def record(
    given: Annotated[
        Given,
        robot_and("FILE.mcap", "FILE.mcap may be a folder: a file in it is named by the time."),
    ],
    seconds: Annotated[float, typer.Option(min=0.0)] = 0.0,
) -> None:
    """Record all that crosses the link, until Ctrl-C or SIGTERM. Sends no setpoint.

    Beside a program that holds the port it records that program's link, until it ends. Overwrites
    no file: the new one's name gets a number. Goes on when a lost link is back.

    Args:
        given: The robot.
        seconds: For how long; 0: until Ctrl-C.
    """
    from wheelwire.log.recorder import recording_path

    given, (file,) = given.split("FILE")
    recording_path(file)  # first: a robot should not be opened for nothing
    address = given.resolve()
    if is_recording(address.text):
        raise errors.InvalidArgument(f"{address.text} is a recording already: name a robot")
    # Drop what the log says of the end of the recording: this command reports it.
    logging.getLogger("wheelwire.log").addHandler(logging.NullHandler())
    recorder: Recorder | None = None
    begin = end = time.monotonic()
    lost = 0
    try:
        with ended_by_signals(), address.open_to_look() as driver:
            if not driver.has_device:
                raise errors.DriverUnavailable(
                    f"the driver of {address.text} has no link that could be recorded: "
                    "name another robot"
                )
            name, _ = address.driver(bare=True)
            recorder = driver.record(file, name)
            begin, lost_before = time.monotonic(), driver.statistics.frames_lost
            try:
                print_note(f"recording to {recorder.file}; Ctrl-C ends it")
                _wait(driver, recorder, begin + (seconds or math.inf))
            finally:
                end = time.monotonic()
                lost = driver.statistics.frames_lost - lost_before
    except Interrupted:
        if recorder is None:
            raise
    if recorder.error is not None:
        raise recorder.error
    _say_what_was_written(recorder, end - begin, lost)


def _wait(driver: Robot, recorder: Recorder, until: float) -> None:
    has_asked = ask_for_samples(driver)
    try:
        for change in watch(driver, until):
            if isinstance(change, str):
                print_note(change)
            if recorder.error is not None:
                return
            has_asked = has_asked or ask_for_samples(driver)
            time.sleep(max(0.0, min(LOOK_S, until - time.monotonic())))
    except errors.LinkClosed:
        if not isinstance(driver, AttachedDriver):
            raise
        print_note(f"{driver.holder.name} has ended, and so does the recording")


def _say_what_was_written(recorder: Recorder, duration_s: float, frames_lost: int) -> None:
    sizes = {str(file): file.stat().st_size for file in recorder.files if file.exists()}
    if printed_json(
        {
            "files": sizes,
            "duration_s": duration_s,
            "frames_lost": frames_lost,
            "records_lost": recorder.lost,
        }
    ):
        return
    print_lines(*(f"wrote {file}, {_megabytes(size)}" for file, size in sizes.items()))
    console.print(f"recorded {duration_s:.1f} s; `wheelwire log info` and `log plot` show it")
    if recorder.lost:
        print_lines(f"{recorder.lost} records are missing: this computer or its disk was too slow")


@app.command("info")
def info(file: FileArgument) -> None:
    """Show what a recording holds, and whether it is complete."""
    from wheelwire.log.summary import summary

    found = summary(file)
    if printed_json({"file": str(file), **to_json_value(found)}):
        return
    print_facts(
        f"Recording {file}",
        [
            ("robot", f"{found.board_id or 'unknown'}, driver {found.driver or 'unknown'}"),
            ("began", found.began),
            ("duration", f"{found.duration_s:.3f} s"),
            ("size", _megabytes(found.size_bytes)),
            ("frames received", found.frames_received),
            ("frames sent", found.frames_sent),
            ("frames lost", found.frames_lost),
            ("recorded by", f"Wheelwire {found.version or 'unknown'}"),
            ("complete", _completeness(file, found)),
        ],
    )


def _completeness(file: Path, found: Summary) -> str:
    from wheelwire.log.reader import is_being_written

    if found.complete:
        return "yes"
    if is_being_written(file):
        return "no: it is being recorded"
    if found.ended_by:
        return f"no: its recorder gave up ({found.ended_by}); `wheelwire log repair {file}` ends it"
    return f"no: `wheelwire log repair {file}` writes the end that a crash left out"


@app.command("decode")
def decode(
    file: FileArgument,
    message: Annotated[str | None, typer.Option(autocompletion=lambda: list(MESSAGES))] = None,
) -> None:
    """Print the messages of both directions as CSV, with the values as on the wire.

    `unix_s` is the time of day; `host_s` the host's monotonic clock, as in a sample's stamp.

    Args:
        file: The recording.
        message: Only these, a column for each field: WheelState, SetDuty, ... as in
            protocol/MESSAGES.md.
    """
    from wheelwire.log.reader import check_left_out, offset_us

    wanted = None if message is None else _message(message)
    offset = offset_us(file)
    found = _checked(file)
    # A file that cannot be read does not even get the heading.
    first = next(found, None)
    if first is None:
        check_left_out(file)
    found = chain(() if first is None else (first,), found)
    if wants_json():
        for frame in found:
            if wanted is None or isinstance(frame.message, wanted):
                row = _row(frame, offset)
                unix_s, host_s = float(row.pop("unix_s")), float(row.pop("host_s"))
                values = {name: _json_value(v) for name, v in frame.message._asdict().items()}
                print_json({"unix_s": unix_s, "host_s": host_s, **row, **values})
        return
    table = csv.writer(sys.stdout, lineterminator="\n")
    times = ("unix_s", "host_s", "direction", "message")
    table.writerow((*times, *(("values",) if wanted is None else wanted._fields)))
    for frame in found:
        if wanted is None:
            values = frame.message._asdict().items()
            text = " ".join(f"{name}={_cell(value)}" for name, value in values)
            table.writerow((*_row(frame, offset).values(), text))
        elif isinstance(frame.message, wanted):
            table.writerow((*_row(frame, offset).values(), *map(_cell, frame.message)))


def _message(name: str) -> Any:
    if name in MESSAGES:
        return MESSAGES[name]
    near = errors.meant(name, MESSAGES)
    hint = f"did you mean {near}?" if near else f"there are {', '.join(MESSAGES)}"
    raise errors.InvalidArgument(f"no message has the name {name}: {hint}")


def _checked(file: Path) -> Iterator[Frame]:
    from wheelwire.log.reader import damage_of, records
    from wheelwire.log.rerun import frames

    with damage_of(file):
        yield from frames(records(file))


def _row(frame: Frame, offset: int) -> dict[str, str]:
    unix_us, host_us = frame.host_us + offset, frame.host_us
    return {
        "unix_s": f"{unix_us // 1_000_000}.{unix_us % 1_000_000:06d}",
        "host_s": f"{host_us // 1_000_000}.{host_us % 1_000_000:06d}",
        "direction": "sent" if frame.is_sent else "received",
        "message": type(frame.message).__name__,
    }


def _json_value(value: Any) -> Any:
    if isinstance(value, float):
        return float(_shortest(value))
    return _cell(value) if isinstance(value, bytes) else value


def _cell(value: Any) -> str:
    if isinstance(value, bytes):
        text = value.rstrip(b"\0")
        return (
            text.decode("ascii") if text.isascii() and text.decode().isprintable() else value.hex()
        )
    if isinstance(value, tuple):
        return ";".join(map(_cell, value))
    if isinstance(value, float):
        return _shortest(value)
    return str(value)


def _shortest(value: float) -> str:
    """The number with the digits that distinguish it from all others of 32 bits."""
    text = f"{value:.7g}"
    return text if _F32.pack(float(text)) == _F32.pack(value) else f"{value:.9g}"


def draw_recording(
    file: Path,
    picture: Path,
    title: str | None = None,
    window_us: tuple[float, float] | None = None,
) -> None:
    """Draw a recording.

    Args:
        file: The recording.
        picture: To be written.
        title: Title of the picture; default: the file, its robot, when it began and how long it is.
        window_us: Begin and end, by the recording's clock; default: all.

    Raises:
        DriverUnavailable: matplotlib is not installed.
        RecordingError: The file is not a recording, or damaged.
        OutputFailed: The picture cannot be written.
    """
    if find_spec("matplotlib") is None:
        raise errors.DriverUnavailable(
            "a picture needs matplotlib: run pip install 'wheelwire[tools]'"
        )
    from wheelwire.log.plot import Trace, draw
    from wheelwire.log.reader import damage_of, metadata, session_records
    from wheelwire.log.summary import time_of_day
    from wheelwire.tools.tune.before_after import check_picture

    said = metadata(file)
    check_writable(picture)
    check_picture(picture)
    with damage_of(file):
        trace = Trace.of(session_records(file))
    window = None
    if window_us is not None:
        begin_us, end_us = window_us
        window = (begin_us - trace.begin_us) / 1e6, (end_us - trace.begin_us) / 1e6
    if title is None:
        robot, began = said.get("board_id", "a robot"), time_of_day(trace.begin_us, file)
        title = f"{file.name}: {robot}, {began}, {trace.end_s:.1f} s"
    with errors.OutputFailed.of(picture):
        draw(trace, title, picture, window)


@app.command("plot")
def plot(file: FileArgument, output: Path | None = None) -> None:
    """Draw speeds asked and measured, duties, states and faults of a recording.

    Args:
        file: The recording.
        output: The picture, .png, .svg or .pdf; default: FILE.png beside the file.
    """
    from wheelwire.log.reader import metadata

    if output is None:
        metadata(file)  # first: the picture's name comes from the file
    picture = output or file.with_suffix(".png")
    draw_recording(file, picture)
    print_result({"picture": str(picture)}, f"drew {picture}")


@app.command("repair")
def repair_file(file: FileArgument) -> None:
    """Write the end that a recording lacks after a crash or a power cut.

    The next recording in the same folder does this too.
    """
    from wheelwire.log.repair import repair

    was_repaired = repair(file)
    text = f"{file} is complete: nothing was changed"
    if was_repaired:
        text = f"repaired {file}: `wheelwire log info {file}` shows it"
    print_result({"file": str(file), "repaired": was_repaired}, text)


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"
