"""`wheelwire why`: why the robot stopped, in plain words, with the evidence.

What it needs of `wheelwire.log.why` it imports itself: other commands start without it.
"""

from __future__ import annotations

import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wheelwire.connect import is_recording
from wheelwire.errors import DriverUnavailable, InvalidArgument, RecordingError
from wheelwire.link.clock import host_clock_us
from wheelwire_protocol.codes import StopCause

from .address import Address, BaudRateOption, RobotArgument, resolve
from .box_rerun import rerun_file
from .device_boxes import check_folder, is_box, stops_of_file, write_boxes
from .log import draw_recording
from .output import JsonFlag, print_json, print_lines
from .registry import Heading, command

if TYPE_CHECKING:
    from wheelwire.log.why import Stop

BEFORE_S, AFTER_S = 4.0, 1.0
"""The time around the newest stop that the picture shows."""
NOTHING = "Nothing has stopped the robot in this file."


@command("why", Heading.LOOK, 4, page="why")
def why(
    robot: RobotArgument = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="PNG", help="Draw the seconds around a recording's newest stop."),
    ] = None,
    rerun: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Give the inputs in a black box to the same core again; exit code 31 if it "
            "differs.",
            show_default=False,
        ),
    ] = None,
    export_test: Annotated[
        bool,
        typer.Option(
            "--export-test",
            help="With --rerun: write the box as a regression test, in place of ROBOT a PATH: a "
            "file, a folder, or a checkout of Wheelwire; default: the checkout that this is run "
            "in.",
        ),
    ] = False,
    save_boxes: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Write the black boxes that ROBOT has stored into this folder, each a file for "
            "`wheelwire why FILE.box`.",
            show_default=False,
        ),
    ] = None,
    baud_rate: BaudRateOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Explain why the robot stopped, from a recording FILE.mcap, a black box FILE.box, or a ROBOT.

    From a ROBOT it reads the stops that the robot has recorded by itself, and what holds it now. It
    names a cause, what shows it, and what to look at first; where the data cannot decide, the
    causes that are left. With --rerun it runs the inputs in a black box again.
    """
    if rerun is not None:
        if plot is not None:
            raise InvalidArgument("--plot draws a recording, not a black box: leave it out")
        rerun_file(rerun, robot, export=export_test, as_json=as_json)
        return
    if export_test:
        raise InvalidArgument("--export-test needs a black box: --rerun FILE --export-test")
    address = resolve(robot, as_json=as_json)
    _check_options(address.text, plot, save_boxes)
    facts: list[str] = []
    if is_recording(address.text):
        said, facts = _of_recording(Path(address.text), plot)
    elif is_box(address.text):
        said = [_said(stop, None) for stop in stops_of_file(Path(address.text))]
        facts = [] if said else [NOTHING]
    else:
        said, facts = _of_robot(address, baud_rate, save_boxes, as_json=as_json)
    if as_json:
        print_json(said)
    else:
        _print(said, facts)


def _check_options(address: str, plot: Path | None, folder: Path | None) -> None:
    if plot is not None and not is_recording(address):
        raise InvalidArgument(f"--plot draws a recording: name FILE.mcap instead of {address}")
    if folder is None:
        return
    if is_recording(address) or is_box(address):
        raise InvalidArgument(f"--save-boxes reads a robot: name one instead of {address}")
    check_folder(folder)


def _of_recording(file: Path, plot: Path | None) -> tuple[list[dict[str, Any]], list[str]]:
    """What stopped the robot, and what was latched before, if that is all."""
    from wheelwire.log.reader import (
        ENDED,
        is_being_written,
        metadata,
        offset_us,
        session_records,
        was_cut,
    )
    from wheelwire.log.why import Diagnosis

    diagnosis = Diagnosis()
    try:
        stops = [
            *diagnosis.feed_all(session_records(file)),
            *diagnosis.end(complete=not was_cut(file)),
        ]
    except ValueError as error:
        raise RecordingError(f"{file}: {error}") from error
    if not stops and not diagnosis.has_heard:
        raise RecordingError(
            f"{file}: the robot was out of reach all the time, so the recording cannot tell "
            "whether something stopped it: `wheelwire why ROBOT` asks the robot itself"
        )
    said = metadata(file)
    added_us = offset_us(file)
    if plot is not None:
        _draw(file, stops, plot)
    facts = [] if stops else [NOTHING]
    if facts and diagnosis.latched_before:
        before = ", ".join(diagnosis.latched_before)
        facts.append(f"It was stopped before the recording began: {before}.")
    if is_being_written(file):
        facts.append("It is being recorded: what comes is not in this yet.")
    elif ENDED in said:
        facts.append(
            f"The recorder gave up before the robot was closed ({said[ENDED]}): what came later is "
            "not in the file."
        )
    return [_said(stop, stop.host_us + added_us) for stop in stops], facts


def _of_robot(
    address: Address, baud_rate: int | None, folder: Path | None, *, as_json: bool
) -> tuple[list[dict[str, Any]], list[str]]:
    """What stopped the robot, and other facts that are worth a line."""
    from wheelwire.log.why.device import ledger_facts, stops_of_device

    with address.open_to_look(baud_rate, as_json=as_json) as driver:
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


def _draw(file: Path, stops: list[Stop], picture: Path) -> None:
    if not stops:
        raise InvalidArgument(f"{file}: nothing has stopped the robot: there is nothing to draw")
    newest = stops[-1]
    window_us = newest.host_us - BEFORE_S * 1e6, newest.host_us + AFTER_S * 1e6
    draw_recording(file, picture, newest.sentence, window_us)
