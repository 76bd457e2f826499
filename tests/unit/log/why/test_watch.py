"""Stops are reported while a program drives, beside it."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import pytest

import wheelwire
from support.lost_answers import LostAnswers
from support.waiting import until, wait_until
from wheelwire import aio
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import DeviceRefused, InvalidArgument, InvalidCommand, LinkLost
from wheelwire.log.why.diagnosis import Diagnosis, Stop
from wheelwire.log.why.watch import StopWatch
from wheelwire.robot.robot import Robot
from wheelwire_protocol.codes import ResetReason
from wheelwire_protocol.types import GroupInfo

pytestmark = pytest.mark.timeout(60)
PATIENCE_S = 20.0


def causes(reports: list[Stop], number: int) -> list[str]:
    """Those of the stops, once there are so many."""
    wait_until(lambda: len(reports) >= number, PATIENCE_S)
    return [stop.cause for stop in reports]


def drive(robot: Robot) -> None:
    began_s = time.monotonic()
    while True:
        # Out of reach while the session after a reset is opened, and held until the zero.
        with suppress(LinkLost):
            if robot.is_unarmed:
                robot.set_velocity(0.0, 0.0)
            with suppress(DeviceRefused):
                robot.set_velocity(0.2, 0.0, ttl=0.5)
            if drives_since(began_s, robot.read(PATIENCE_S)):
                return


def drives_since(began_s: float, sample: wheelwire.WheelSample) -> bool:
    # An unread sample may be older than the stop before this drive.
    return sample.state is wheelwire.SupervisorState.DRIVING and sample.stamp > began_s


def test_each_stop_is_reported_once() -> None:
    reports: list[Stop] = []
    with wheelwire.open_driver("mock") as robot:
        watch = robot.watch_stops(reports.append)
        drive(robot)
        assert causes(reports, 1) == ["program_paused"]
        drive(robot)
        robot.stop()
        assert causes(reports, 2) == ["program_paused", "stop_by_session"]
        watch.close()
        watch.close()
        robot.estop()
    assert len(reports) == 2


def test_a_watch_misses_no_stop_while_the_session_still_asks_for_the_board(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reports: list[Stop] = []
    with wheelwire.open_driver("mock") as robot:
        assert isinstance(robot, MockDriver)
        before = robot.info.device.boot_id
        lost = LostAnswers(monkeypatch, GroupInfo, 4)
        robot.simulator.reset(ResetReason.POWER_ON)
        while robot.info.device.boot_id == before:
            with suppress(LinkLost):
                robot.read(PATIENCE_S)
        drive(robot)
        robot.watch_stops(reports.append)  # most computers get here before the board is known
        robot.estop()
        with pytest.raises(DeviceRefused) as refused:
            robot.set_velocity(0.1, 0.0)
        assert refused.value.why == "The emergency stop was requested over this link."
        assert causes(reports, 1) == ["estop_by_session"]
        assert lost.left == 0


def test_an_exception_in_a_report_ends_nothing(caplog: pytest.LogCaptureFixture) -> None:
    reports: list[Stop] = []

    def fail(stop: Stop) -> None:
        reports.append(stop)
        raise RuntimeError("mine")

    with wheelwire.open_driver("mock") as robot:
        robot.watch_stops(fail)
        for number in (1, 2):
            drive(robot)
            robot.stop()
            causes(reports, number)
    assert "the function to call at a stop has failed" in caplog.text


def test_a_chip_that_resets_is_reported_and_watched_on() -> None:
    reports: list[Stop] = []
    with wheelwire.open_driver("mock") as robot:
        assert isinstance(robot, MockDriver)
        robot.watch_stops(reports.append)
        drive(robot)
        robot.simulator.reset(ResetReason.TASK_WATCHDOG)
        assert causes(reports, 1) == ["task_watchdog"]
        assert "TASK_WATCHDOG" in reports[0].evidence[0]
        drive(robot)
        robot.stop()
        assert causes(reports, 2) == ["task_watchdog", "stop_by_session"]


# --- asyncio -----------------------------------------------------------------------------------


async def drive_in_loop(robot: aio.Driver) -> None:
    began_s = time.monotonic()
    while True:
        with suppress(LinkLost):
            robot.set_velocity(0.2, 0.0, ttl=0.5)
            if drives_since(began_s, await robot.read(PATIENCE_S)):
                return


async def test_a_loop_hears_of_each_stop_in_its_own_thread() -> None:
    found: list[tuple[str, bool]] = []
    own = threading.get_ident()

    async def report(stop: Stop) -> None:
        await asyncio.sleep(0)
        found.append((stop.cause, threading.get_ident() == own))

    async with aio.open_driver("mock") as robot:
        watch = await robot.watch_stops(report)
        await drive_in_loop(robot)
        await until(lambda: len(found) == 1)
        await robot.estop()
        await until(lambda: len(found) == 2)
        latched = watch.latched()
        assert latched is not None
        with pytest.raises(DeviceRefused) as raised:
            robot.set_velocity(0.2, 0.0)
        assert raised.value.why == latched.sentence
        await watch.close()
        await watch.close()
        await robot.clear_estop()
        await robot.estop()
        assert watch.latched() is None
    assert found == [("program_paused", True), ("estop_by_session", True)]


async def test_a_report_may_close_the_robot_and_ends_no_loop() -> None:
    closed: list[str] = []

    async with aio.open_driver("mock") as robot:

        async def report(stop: Stop) -> None:
            await robot.close()
            closed.append(stop.cause)

        await robot.watch_stops(report)
        await drive_in_loop(robot)
        await robot.stop()
        await until(lambda: bool(closed))
    assert closed == ["stop_by_session"]
    assert not [one.name for one in threading.enumerate() if one.name == "wheelwire stops"]


@pytest.mark.parametrize("begun", [False, True], ids=["before", "after"])
async def test_a_loop_s_watch_that_is_cancelled_while_it_begins_is_closed(
    monkeypatch: pytest.MonkeyPatch, *, begun: bool
) -> None:
    begins, goes_on, has_begun = threading.Event(), threading.Event(), threading.Event()
    watch_stops = Robot.watch_stops

    def slow(robot: Robot, report: Callable[[Stop], object]) -> StopWatch:
        begins.set()
        assert goes_on.wait(PATIENCE_S)
        watch = watch_stops(robot, report)
        has_begun.set()
        return watch

    monkeypatch.setattr(Robot, "watch_stops", slow)
    async with aio.open_driver("mock") as robot:
        task = asyncio.create_task(robot.watch_stops(print))
        await until(begins.is_set)
        if begun:
            # Before the loop runs again: the task is cancelled although it is done.
            goes_on.set()
            assert has_begun.wait(PATIENCE_S)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        goes_on.set()
        assert await asyncio.to_thread(has_begun.wait, PATIENCE_S)
        await until(lambda: "wheelwire stops" not in [one.name for one in threading.enumerate()])
        await robot.read()


async def test_a_loop_cannot_watch_virtual_time_nor_call_what_is_no_function() -> None:
    async with aio.open_driver("mock", realtime=False) as robot:
        with pytest.raises(InvalidCommand, match="only a robot in real time"):
            await robot.watch_stops(print)
        with pytest.raises(InvalidArgument, match="watch_stops = 1"):
            await robot.watch_stops(1)  # type: ignore[arg-type]


def test_a_watch_that_fails_says_so_and_the_robot_is_driven_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("a bug")

    with wheelwire.open_driver("mock") as robot, robot.watch_stops(print) as watch:
        assert watch.error is None
        monkeypatch.setattr(Diagnosis, "feed_all", fail)
        wait_until(lambda: watch.error is not None)
        assert "a bug" in str(watch.error)
        assert watch.latched() is None
        drive(robot)
        wait_until(lambda: "wheelwire stops" not in [one.name for one in threading.enumerate()])
