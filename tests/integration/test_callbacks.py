"""`on_lost`, `on_opened`, `on_fault`, of both APIs and in virtual time."""

from __future__ import annotations

import asyncio
import gc
import threading
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import wheelwire
from support.pty_device import PtyDevice
from support.threads import link_threads
from support.waiting import until, wait_until
from wheelwire import Fault, aio
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import LinkClosed, LinkLost, WheelwireError

pytestmark = pytest.mark.timeout(120)
PLUGGINGS = 20


class Heard:
    """What the callbacks of a robot were called with, in order."""

    def __init__(self, robot: Any) -> None:
        self.calls: list[tuple[str, Any]] = []
        robot.on_lost = lambda error: self.calls.append(("lost", error))
        robot.on_opened = lambda device: self.calls.append(("opened", device))
        robot.on_fault = lambda faults: self.calls.append(("fault", faults))

    @property
    def names(self) -> list[str]:
        return [name for name, _ in self.calls]


def drive_until(robot: MockDriver, condition: Callable[[], object]) -> None:
    """Drive in virtual time."""
    for _ in range(200):
        with suppress(WheelwireError):
            robot.set_velocity(0.2, 0.0, ttl=0.2)
        robot.advance(0.05)
        if condition():
            return
    pytest.fail("the condition never held")


# --- what is called, and in which order ------------------------------------------------------


def test_each_loss_and_return_is_reported_once_and_in_order(tmp_path: Path) -> None:
    with PtyDevice(tmp_path / "port") as device, wheelwire.connect(device.path) as robot:
        heard = Heard(robot)
        for number in range(PLUGGINGS):
            device.unplug()
            wait_until(lambda n=number: len(heard.calls) == 2 * n + 1)  # type: ignore[misc]
            device.plug()
            wait_until(lambda n=number: len(heard.calls) == 2 * n + 2)  # type: ignore[misc]
        assert heard.names == ["lost", "opened"] * PLUGGINGS
        assert all(isinstance(told, LinkLost) for name, told in heard.calls if name == "lost")
        boots = {told.boot_id for name, told in heard.calls if name == "opened"}
        assert boots == {device.device.boot_id}
        # A reset is a loss and a return, too.
        device.device.reset()
        wait_until(lambda: len(heard.calls) == 2 * PLUGGINGS + 2)
        assert heard.names[-2:] == ["lost", "opened"]
        assert heard.calls[-1][1].boot_id not in boots


def test_a_slow_callback_misses_no_event(tmp_path: Path) -> None:
    heard: list[str] = []
    with PtyDevice(tmp_path / "port") as device, wheelwire.connect(device.path) as robot:
        goes_on = threading.Event()

        def lost(_: WheelwireError) -> None:
            heard.append("lost")
            goes_on.wait(30)

        robot.on_lost = lost
        robot.on_opened = lambda _: heard.append("opened")
        for _ in range(3):
            sessions = robot.sessions
            device.unplug()
            wait_until(lambda: not robot.is_open)
            device.plug()
            wait_until(lambda n=sessions: robot.is_open and robot.sessions > n)  # type: ignore[misc]
        assert heard == ["lost"]
        goes_on.set()
        wait_until(lambda: len(heard) == 6)
    assert heard == ["lost", "opened"] * 3


async def test_a_slow_coroutine_loses_none_either_and_may_call_the_robot(tmp_path: Path) -> None:
    heard: list[str] = []
    with PtyDevice(tmp_path / "port") as device:
        async with aio.connect(device.path) as robot:
            goes_on = asyncio.Event()

            async def lost(_: WheelwireError) -> None:
                heard.append("lost")
                await goes_on.wait()
                heard.append("seen")

            async def opened(_: object) -> None:
                heard.append("opened")
                assert await robot.parameters.set("max_duty", 0.5) == 0.5
                heard.append("set")

            robot.on_lost, robot.on_opened = lost, opened
            for _ in range(3):
                sessions = robot.sessions
                device.unplug()
                await until(lambda: not robot.is_open)
                device.plug()
                await until(lambda n=sessions: robot.is_open and robot.sessions > n)  # type: ignore[misc]
            assert heard == ["lost"]
            goes_on.set()
            await until(lambda: len(heard) == 12)
    assert heard == ["lost", "seen", "opened", "set"] * 3


def test_each_fault_is_reported_once_and_again_after_a_clear() -> None:
    with MockDriver(realtime=False) as robot:
        heard = Heard(robot)
        for number in (1, 2):
            robot.simulator.set("left.encoder_dead", 1)
            drive_until(robot, lambda n=number: len(heard.calls) == n)  # type: ignore[misc]
            robot.advance(1.0)
            robot.unplug()
            robot.plug()
            robot.advance(1.0)
            robot.simulator.set("left.encoder_dead", 0)
            robot.clear_fault()
            heard.calls = [call for call in heard.calls if call[0] == "fault"]
            robot.set_velocity(0.0, 0.0)
            robot.advance(0.1)
        assert heard.names == ["fault"] * 2
        assert {told for _, told in heard.calls} == {Fault.LEFT_NOT_COUNTING}


def test_a_callback_is_called_at_once_if_its_condition_already_holds() -> None:
    with MockDriver(realtime=False) as robot:
        robot.simulator.set("left.encoder_dead", 1)
        drive_until(robot, lambda: robot.health.faults)
        heard = Heard(robot)
        assert heard.calls == [("fault", Fault.LEFT_NOT_COUNTING)]
        robot.unplug()
        assert heard.names == ["fault", "lost"]
        again = Heard(robot)
        assert again.names == ["lost", "fault"]


def test_an_event_while_a_callback_is_assigned_is_reported_once() -> None:
    """In a callback, so that the news waits: both are so still when that returns."""
    with MockDriver(realtime=False) as robot:
        heard = Heard(robot)

        def assign(_: object) -> None:
            robot.simulator.set("left.encoder_dead", 1)
            drive_until(robot, lambda: robot.health.faults)
            robot.unplug()
            robot.on_lost = lambda error: heard.calls.append(("lost", error))
            robot.on_fault = lambda faults: heard.calls.append(("fault", faults))

        robot.on_opened = assign
        robot.unplug()
        robot.plug()
        robot.advance(1.0)
        assert heard.names == ["lost", "fault", "lost"]
        robot.on_opened = None
        robot.plug()
        robot.advance(1.0)
        robot.unplug()
        assert heard.names == ["lost", "fault", "lost", "lost"]


def test_one_that_was_taken_away_is_not_called() -> None:
    with MockDriver(realtime=False) as robot:
        heard = Heard(robot)
        assert robot.on_lost is not None
        robot.on_lost = None
        assert robot.on_lost is None
        robot.unplug()
        robot.plug()
        robot.advance(1.0)
        assert heard.names == ["opened"]


# --- callbacks that call the robot, and such that fail ---------------------------------------


def test_callbacks_may_call_the_robot() -> None:
    results: list[object] = []

    def ask(call: Callable[[], object]) -> None:
        try:
            results.append(call())
        except WheelwireError as error:
            results.append(type(error))

    with MockDriver() as robot:
        robot.on_lost = lambda _: ask(robot.stop)
        robot.on_opened = lambda _: ask(lambda: robot.parameters.set("max_duty", 0.5))
        robot.unplug()
        robot.plug()
        wait_until(lambda: len(results) == 2)
    assert results == [LinkLost, 0.5]


@pytest.mark.parametrize("error", [ValueError, SystemExit])
def test_an_exception_in_a_callback_is_logged_and_ends_nothing(
    error: type[BaseException], caplog: pytest.LogCaptureFixture
) -> None:
    with MockDriver() as robot:
        heard: list[object] = []

        def fail(_: object) -> None:
            heard.append(_)
            raise error("of the application")

        robot.on_lost = robot.on_opened = fail
        for _ in range(2):
            robot.unplug()
            wait_until(lambda: not robot.is_open)
            robot.plug()
            wait_until(lambda: robot.is_open)
        wait_until(lambda: len(heard) == 4)
        robot.stop()
    texts = [r.getMessage() for r in caplog.records if r.exc_info]
    assert texts.count("on_lost raised an exception; the link goes on") == 2
    assert texts.count("on_opened raised an exception; the link goes on") == 2


async def test_an_exception_in_a_coroutine_is_logged_even_if_it_cancels_itself(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with aio.open_driver("mock") as robot:
        heard: list[object] = []

        async def cancel(_: object) -> None:
            heard.append(_)
            task = asyncio.current_task()
            assert task is not None
            task.cancel()
            await asyncio.sleep(1)

        async def fail(_: object) -> None:
            heard.append(_)
            raise ValueError("of the application")

        robot.on_lost, robot.on_opened = cancel, fail
        for number in (2, 4):
            robot.unplug()
            await until(lambda: not robot.is_open)
            robot.plug()
            await until(lambda n=number: len(heard) == n)  # type: ignore[misc]
        await robot.stop()
    texts = [r.getMessage() for r in caplog.records if r.exc_info]
    assert texts.count("on_lost raised an exception; the link goes on") == 2
    assert texts.count("on_opened raised an exception; the link goes on") == 2


# --- closing ---------------------------------------------------------------------------------


def test_a_callback_may_close_the_robot() -> None:
    closed = threading.Event()
    robot = MockDriver()

    def close(_: object) -> None:
        robot.close()
        robot.close()
        closed.set()

    heard: list[object] = []
    robot.on_opened = heard.append
    robot.on_lost = close
    robot.unplug()
    assert closed.wait(10)
    with pytest.raises(LinkClosed):
        robot.stop()
    robot.close()
    wait_until(lambda: not link_threads())
    assert heard == []


async def test_a_callback_may_close_the_robot_with_asyncio() -> None:
    robot = await aio.open_driver("mock")
    closed = asyncio.Event()

    async def close(_: object) -> None:
        begin = time.monotonic()
        await robot.close()
        assert time.monotonic() - begin < 0.9
        closed.set()

    robot.on_lost = close
    robot.unplug()
    await asyncio.wait_for(closed.wait(), 10)
    await robot.close()
    with pytest.raises(LinkClosed):
        await robot.stop()


def test_none_is_called_once_the_robot_is_closed(tmp_path: Path) -> None:
    """Closed at a random moment of a loss, again and again."""
    with PtyDevice(tmp_path / "port") as device:
        for number in range(30):
            late: list[object] = []
            heard: list[object] = []
            robot = wheelwire.connect(device.path)
            robot.on_lost = robot.on_opened = heard.append
            if number % 2:
                device.device.reset()
            time.sleep(number * 0.0007)
            robot.close()
            count = len(heard)
            time.sleep(0.005)
            assert len(heard) == count
            robot.on_lost = late.append  # of a closed robot
    assert late == []
    assert not link_threads()


def test_closing_waits_for_a_callback_but_not_for_ever() -> None:
    robot = MockDriver()
    entered, goes_on = threading.Event(), threading.Event()

    def hang(_: object) -> None:
        entered.set()
        goes_on.wait(30)

    robot.on_lost = hang
    robot.unplug()
    assert entered.wait(10)
    begin = time.monotonic()
    robot.close()
    assert 0.9 < time.monotonic() - begin < 5
    goes_on.set()
    wait_until(lambda: not link_threads())


def test_a_robot_that_is_forgotten_ends_its_thread() -> None:
    robot = MockDriver()
    heard: list[object] = []
    robot.on_lost = partial(_refers_to, robot, heard)
    gone = weakref.ref(robot)
    assert "wheelwire callbacks" in link_threads()
    del robot
    gc.collect()
    assert gone() is None
    wait_until(lambda: not link_threads())
    assert heard == []


def _refers_to(_robot: object, heard: list[object], told: object) -> None:
    heard.append(told)
