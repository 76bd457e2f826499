"""What a signal leaves behind: a robot that stands, and one line that says so."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from wheelwire import LinkLost, open_driver
from wheelwire.cli.interruptions import Interrupted, ended_by_signals
from wheelwire.drivers.mock import MockDriver

CODES = [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """As a terminal starts a command; put back afterwards."""
    kinds: dict[signal.Signals, Any] = {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
        signal.SIGHUP: signal.SIG_DFL,
    }
    before = {number: signal.signal(number, kind) for number, kind in kinds.items()}
    yield
    assert {number: signal.getsignal(number) for number in kinds} == kinds
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def robot() -> Iterator[MockDriver]:
    with open_driver("mock") as robot:
        yield robot


def send(number: int) -> None:
    os.kill(os.getpid(), number)
    for _ in range(100_000):  # until Python has handled it
        pass


@pytest.mark.parametrize(("number", "code"), CODES)
def test_a_signal_stops_the_robot_and_says_so(
    robot: MockDriver, number: signal.Signals, code: int
) -> None:
    robot.set_velocity(0.2, 0.0, 1.0)
    with pytest.raises(Interrupted, match=r"^stopped; go on later$") as ended:  # noqa: SIM117
        with ended_by_signals() as ending, ending.stops(robot, lambda: "go on later"):
            send(number)
    stopped_s = time.monotonic()
    assert ended.value.exit_code == code
    sample = robot.read()
    while sample.stamp - sample.stamp_error_s < stopped_s:
        sample = robot.read()
    assert sample.state.name == "IDLE"  # by a stop: the setpoint has not expired yet


def test_ctrl_c_at_a_question_stops_the_robot_too(robot: MockDriver) -> None:
    """typer makes an exception of its own of it."""
    with pytest.raises(Interrupted, match="stopped"):  # noqa: SIM117
        with ended_by_signals() as ending, ending.stops(robot):
            raise typer.Abort


def test_an_unacknowledged_stop_is_not_reported_as_a_stop(
    robot: MockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost() -> None:
        raise LinkLost("the port is gone")

    monkeypatch.setattr(robot, "stop", lost)
    with pytest.raises(Interrupted, match=r"not acknowledged \(the port is gone\); the robot"):  # noqa: SIM117
        with ended_by_signals() as ending, ending.stops(robot):
            send(signal.SIGTERM)
    monkeypatch.undo()


def test_a_second_signal_does_not_cut_the_stop_short(
    robot: MockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A service manager sends SIGTERM and SIGHUP one after the other."""
    stop, stops = robot.stop, []

    def interrupted_stop() -> None:
        send(signal.SIGHUP)
        send(signal.SIGTERM)
        stop()
        stops.append(True)

    monkeypatch.setattr(robot, "stop", interrupted_stop)
    with pytest.raises(Interrupted) as ended:  # noqa: SIM117
        with ended_by_signals() as ending, ending.stops(robot):
            send(signal.SIGTERM)
    assert stops == [True]
    assert ended.value.exit_code == 143
    monkeypatch.undo()


def test_a_signal_before_the_robot_was_open_says_that_nothing_was_done() -> None:
    with pytest.raises(Interrupted, match="before anything was done"), ended_by_signals():
        send(signal.SIGTERM)


def test_what_nohup_ignores_stays_ignored(robot: MockDriver) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with ended_by_signals() as ending, ending.stops(robot):
        send(signal.SIGHUP)
    assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
