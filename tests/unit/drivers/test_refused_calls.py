"""What a program does wrong is refused at once, and says what to do; nothing is lost in a log."""

from __future__ import annotations

import copy
import json
import math
import pickle
import threading
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wheelwire
from support.cases import each
from support.command import check_error, run
from wheelwire import errors, open_driver
from wheelwire.link.session import Session
from wheelwire.link.traffic import Kind, TrafficReader
from wheelwire.log.reader import records

pytestmark = pytest.mark.timeout(60)


def notes(robot: Any, *values: object) -> list[Any]:
    """What the tap passes on of these notes."""
    reader = TrafficReader()
    robot._link.listen_to_traffic(reader)
    for value in values:
        robot.note("n", value)
    return [json.loads(one.data)["n"] for one in reader.take() if one.kind is Kind.NOTE][
        -len(values) :
    ]


def test_a_note_takes_what_programs_have() -> None:
    moment = datetime(2026, 11, 28, 12, 30, tzinfo=timezone.utc)
    values = [
        np.float32(0.5),
        np.arange(3),
        Path("/a/b"),
        moment,
        wheelwire.Fault.EXTERNAL,
        [1, {"a": None}],
    ]
    with open_driver("mock", realtime=False) as robot:
        found = notes(robot, *values)
    assert found == [
        0.5,
        [0, 1, 2],
        "/a/b",
        moment.isoformat(),
        int(wheelwire.Fault.EXTERNAL),
        [1, {"a": None}],
    ]


@each("value", [object(), {(1, 2): 3}, {1, 2}, b"bytes", open_driver, 1j])
def test_a_note_that_cannot_be_written_is_refused_and_breaks_nothing(value: object) -> None:
    with open_driver("mock", realtime=False) as robot:
        assert robot.has_device
        with pytest.raises(errors.InvalidArgument, match="note n"):
            robot.note("n", value)
        circle: list[Any] = []
        circle.append(circle)
        with pytest.raises(errors.InvalidArgument, match="note n"):
            robot.note("n", circle)
        with pytest.raises(errors.InvalidArgument, match="name = 3"):
            robot.note(3, 1)  # type: ignore[arg-type]
        assert notes(robot, math.pi) == [math.pi]  # as before


class Awaited:
    async def __call__(self, _: object) -> None: ...


async def report(_: object) -> None: ...


@each("function", [report, partial(report), Awaited(), 1, "print"])
def test_stops_are_reported_to_plain_functions(function: Any) -> None:
    with open_driver("mock") as robot:
        assert robot.has_device
        with pytest.raises(
            errors.InvalidArgument, match=r"watch_stops = .*: give a (plain )?function"
        ):
            robot.watch_stops(function)
        with pytest.raises(errors.InvalidArgument, match="on_lost = "):
            robot.on_lost = function


def test_a_function_that_is_assigned_to_a_wrong_name_is_refused() -> None:
    robot: Any
    with open_driver("mock", realtime=False) as robot:
        with pytest.raises(errors.InvalidArgument, match="did you mean on_lost"):
            robot.on_los = print
        with pytest.raises(
            errors.InvalidArgument, match="there are on_fault, on_held, on_lost, on_opened"
        ):
            robot.on_xyz = print
        robot.on_lost = print
        robot.my_own = 3


@each("give", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_robot_is_not_given_to_another_process(give: Any) -> None:
    with (
        open_driver("mock", realtime=False) as robot,
        pytest.raises(errors.InvalidArgument, match="open it in the process that drives"),
    ):
        give(robot)


def test_a_closed_robot_is_not_entered_again() -> None:
    robot = open_driver("mock", realtime=False)
    robot.close()
    with pytest.raises(errors.LinkClosed, match="open it again"), robot:
        pass


def test_a_recording_needs_a_path() -> None:
    with open_driver("mock") as robot:
        assert robot.has_device
        with pytest.raises(errors.InvalidArgument, match="path = 5"):
            robot.record(5)  # type: ignore[arg-type]
        with pytest.raises(errors.InvalidArgument, match="no file can have this name"):
            robot.record("a\0.mcap")
        for name in ("/dev/full", "day", "day.mcap.bak"):
            with pytest.raises(errors.InvalidArgument, match=r"ends in \.mcap, or name a folder"):
                robot.record(name)


def test_a_folder_is_refused_as_a_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "name a recording" in check_error(run("log", "plot", "."), errors.RecordingError)


def test_a_recording_that_never_began_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As with a Python on which a session cannot say how it is."""

    def fail(_: Session) -> Any:
        raise TypeError("cannot pickle 'itertools.count' object")

    monkeypatch.setattr("wheelwire.link.handover.start_of", fail)
    with open_driver("mock") as robot:
        assert robot.has_device
        with pytest.raises(errors.WheelwireError, match="the call failed"):
            robot.record(tmp_path / "day.mcap")
        with pytest.raises(errors.WheelwireError, match="the call failed"):
            robot.watch_stops(print)
    with pytest.raises(errors.WheelwireError, match="the call failed"):
        open_driver("mock", record=tmp_path)
    result = run("log", "record", "mock", str(tmp_path / "day.mcap"), "--seconds", "0.2")
    assert result.returncode == 1, result.stdout
    assert "the call failed" in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_recorder_and_a_watch_end_with_their_block(tmp_path: Path) -> None:
    with open_driver("mock") as robot:
        assert robot.has_device
        with robot.record(tmp_path / "day.mcap") as recorder, robot.watch_stops(print):
            robot.read()
        assert {"wheelwire recorder", "wheelwire stops"}.isdisjoint(
            one.name for one in threading.enumerate()
        )
        robot.read()
    assert list(records(recorder.file))
