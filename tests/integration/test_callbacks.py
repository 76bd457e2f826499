"""`on_lost`, `on_opened`, `on_fault`, of both APIs and in virtual time."""

from __future__ import annotations

import asyncio
import gc
import logging
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
from support.cases import each
from support.pty_device import PtyDevice
from support.threads import link_threads
from support.waiting import until, wait_until
from wheelwire import Fault, aio
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import InvalidArgument, LinkClosed, LinkLost, WheelwireError

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


def test_a_reset_is_a_loss_and_a_return(tmp_path: Path) -> None:
    with PtyDevice(tmp_path / "port") as device, wheelwire.connect(device.path) as robot:
        heard = Heard(robot)
        before = device.device.boot_id
        device.device.reset()
        wait_until(lambda: heard.names == ["lost", "opened"])
        assert heard.calls[1][1].boot_id == device.device.boot_id != before


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


async def test_a_slow_coroutine_loses_none_either(tmp_path: Path) -> None:
    heard: list[str] = []
    with PtyDevice(tmp_path / "port") as device:
        async with aio.connect(device.path) as robot:
            goes_on = asyncio.Event()

            async def lost(_: WheelwireError) -> None:
                heard.append("lost")
                await goes_on.wait()
                heard.append("seen")

            robot.on_lost = lost
            robot.on_opened = lambda _: heard.append("opened")
            for _ in range(3):
                sessions = robot.sessions
                device.unplug()
                await until(lambda: not robot.is_open)
                device.plug()
                await until(lambda n=sessions: robot.is_open and robot.sessions > n)  # type: ignore[misc]
            assert heard == ["lost"]
            goes_on.set()
            await until(lambda: len(heard) == 9)
    assert heard == ["lost", "seen", "opened"] * 3


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


def test_the_thread_reports_a_loss_once_while_on_lost_is_assigned() -> None:
    heard: list[str] = []
    with MockDriver() as robot:

        def assign(_: object) -> None:
            if "assigned" in heard:
                heard.append("opened")
                return
            robot.unplug()
            wait_until(lambda: not robot.is_open)
            robot.on_lost = lambda _: heard.append("lost")
            heard.append("assigned")

        robot.on_opened = assign
        robot.unplug()
        robot.plug()
        wait_until(lambda: "lost" in heard)
        robot.plug()
        wait_until(lambda: "opened" in heard)
    assert heard == ["assigned", "lost", "opened"]


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


def test_what_cannot_be_called_is_refused() -> None:
    async def coroutine(_: object) -> None: ...

    with MockDriver(realtime=False) as robot:
        with pytest.raises(InvalidArgument, match=r"on_lost = 3: give a function, or None"):
            robot.on_lost = 3  # type: ignore[assignment]
        with pytest.raises(InvalidArgument, match=r"on_fault = .* wheelwire\.aio"):
            robot.on_fault = coroutine
        assert robot.on_lost is None and robot.on_fault is None  # noqa: PT018
    with wheelwire.connect("mock") as real, pytest.raises(InvalidArgument, match="plain function"):
        real.on_opened = coroutine


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


async def test_coroutines_may_call_the_robot() -> None:
    results: list[object] = []
    async with aio.open_driver("mock") as robot:

        async def lost(_: WheelwireError) -> None:
            try:
                await robot.stop()
            except WheelwireError as error:
                results.append(type(error))
            robot.plug()

        async def opened(_: object) -> None:
            results.append(await robot.parameters.set("max_duty", 0.5))

        robot.on_lost, robot.on_opened = lost, opened
        robot.unplug()
        await until(lambda: len(results) == 2)
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


def stop_again_and_again(robot: MockDriver) -> None:
    for _ in range(100):
        robot.stop()


def test_unplugged_in_the_middle_of_a_callback() -> None:
    heard: list[str] = []
    with MockDriver() as robot:

        def opened(_: object) -> None:
            heard.append("opened")
            if len(heard) < 6:
                robot.unplug()
                heard.append("unplugged")
                with pytest.raises(WheelwireError):
                    stop_again_and_again(robot)

        def lost(_: object) -> None:
            heard.append("lost")
            robot.plug()

        robot.on_opened, robot.on_lost = opened, lost
        robot.unplug()
        wait_until(lambda: len(heard) >= 8)
    assert heard[:8] == [*["lost", "opened", "unplugged"] * 2, "lost", "opened"]


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


def test_a_callback_may_close_the_robot_in_virtual_time() -> None:
    robot = MockDriver(realtime=False)
    robot.on_opened = lambda _: robot.close()
    robot.unplug()
    robot.plug()
    with pytest.raises(LinkClosed):
        robot.advance(1.0)
    robot.close()


@pytest.mark.parametrize("is_coroutine", [False, True])
async def test_a_callback_may_close_the_robot_with_asyncio(*, is_coroutine: bool) -> None:
    robot = await aio.open_driver("mock")
    closed = asyncio.Event()
    tasks = []

    async def close(_: object = None) -> None:
        begin = time.monotonic()
        await robot.close()
        assert time.monotonic() - begin < 0.9
        closed.set()

    def begin_to_close(_: object) -> None:
        tasks.append(asyncio.ensure_future(close()))

    robot.on_lost = close if is_coroutine else begin_to_close
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


@each("is_asked_for", ["set_velocity", "read", "contradictions", "warnings"])
def test_a_robot_that_is_forgotten_after_an_error_ends_its_thread(is_asked_for: str) -> None:
    """An error that the link raises repeatedly keeps none of its receivers alive."""

    def use(robot: MockDriver) -> None:
        robot.unplug()
        while True:
            if is_asked_for == "warnings":
                assert robot.warnings == ()
            elif is_asked_for == "set_velocity":
                robot.set_velocity(0.1, 0.0)
            elif is_asked_for == "read":
                robot.read(0.1)  # the tests' own time-out is half a minute
            else:
                robot.contradictions()

    robot = MockDriver()
    gone = weakref.ref(robot)
    with pytest.raises(LinkLost):
        use(robot)
    del robot
    gc.collect()
    assert gone() is None
    wait_until(lambda: not link_threads())


def _refers_to(_robot: object, heard: list[object], told: object) -> None:
    heard.append(told)


async def test_a_robot_that_is_forgotten_with_asyncio_is_freed() -> None:
    robot = await aio.open_driver("mock")
    heard: list[object] = []
    robot.on_lost = partial(_refers_to, robot, heard)
    gone = weakref.ref(robot)
    del robot
    gc.collect()
    assert gone() is None
    await asyncio.sleep(0.2)
    assert heard == []


def test_a_loop_that_ends_in_a_callback_leaves_nothing_behind(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def use() -> None:
        robot = await aio.open_driver("mock")
        entered = asyncio.Event()

        async def hang(_: object) -> None:
            entered.set()
            await asyncio.sleep(60)

        robot.on_lost = hang
        robot.unplug()
        await entered.wait()

    with caplog.at_level(logging.ERROR):
        asyncio.run(use())
    gc.collect()
    assert not [r for r in caplog.records if r.levelno >= logging.ERROR]
