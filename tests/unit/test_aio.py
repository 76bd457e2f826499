"""The drivers for asyncio, with a device that answers within the write, or behind a pty."""

from __future__ import annotations

import asyncio
import gc
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial

import pytest

from support.answering_port import Port
from support.core_device import CoreDevice
from support.processes import open_files, opened_since
from support.pty_device import PtyDevice
from support.waiting import until, wait_until
from wheelwire import aio, errors
from wheelwire.link.clock import host_clock_us
from wheelwire.link.connection import Link, LinkOptions
from wheelwire.robot.loop_link import LoopCalls
from wheelwire.robot.robot import Robot, opened_later
from wheelwire_protocol.codes import SupervisorEvent, SupervisorState
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import ParameterGet, ParameterSet, SetDuty, SetWheelVelocity

pytestmark = pytest.mark.timeout(60)

Call = Callable[[aio.Driver], Awaitable[object]]

CALLS: dict[str, Call] = {
    "clear_estop": lambda robot: robot.clear_estop(),
    "clear_fault": lambda robot: robot.clear_fault(),
    "read": lambda robot: robot.read(),
    "samples": lambda robot: anext(robot.samples()),
    "get_encoder_ticks": lambda robot: robot.get_encoder_ticks(),
    "device_counters": lambda robot: robot.device_counters(),
    "control_counters": lambda robot: robot.control_counters(),
    "contradictions": lambda robot: robot.contradictions(),
    "set": lambda robot: robot.parameters.set("integral_gain", 7.5),
    "refresh": lambda robot: robot.parameters.refresh(),
    "list": lambda robot: robot.parameters.list(),
    "save": lambda robot: robot.parameters.save(),
    "reset": lambda robot: robot.parameters.reset(),
}
"""All that is awaited, but for what stops."""

STOPS: dict[str, Call] = {"stop": lambda robot: robot.stop(), "estop": lambda robot: robot.estop()}
MOST_ITERATIONS = 60


class Place:
    """Where a device is: opens ports to it."""

    def __init__(self) -> None:
        self.device = CoreDevice(ttl_max_s=5.0)
        self.ports: list[Port] = []

    def open(self, _baud_rate: int) -> Port:
        self.ports.append(Port(self.device))
        return self.ports[-1]

    def opening(self, stream_rate_hz: int | None = None) -> aio.Opening[aio.Driver]:
        options = LinkOptions("place", stream_rate_hz=stream_rate_hz, open_port=self.open)

        def make() -> aio.Driver:
            with opened_later():
                return aio.Driver(Robot(partial(Link, options)))

        return aio.Opening(make)

    @property
    def is_open(self) -> bool:
        return any(port.fileno() >= 0 for port in self.ports)

    def state(self) -> SupervisorState:
        """The device's, its deadline allowed for."""
        self.device.advance(host_clock_us())
        return self.device.supervisor


@pytest.fixture
def place() -> Place:
    return Place()


def other_tasks() -> list[str]:
    return [task.get_name() for task in asyncio.all_tasks() if task is not asyncio.current_task()]


async def drive(place: Place, robot: aio.Driver) -> None:
    """Have the device drive, and go on driving for long."""
    place.device.obeyed.clear()
    robot.set_velocity(0.2, 0.0, ttl=5.0)
    await until(lambda: place.device.obeyed)
    assert place.state() is SupervisorState.DRIVING


async def cancelled_after(iterations: int, awaitable: Awaitable[object]) -> bool:
    """Cancel it after so many iterations of the loop; False when it ended before."""
    task = asyncio.ensure_future(awaitable)
    for _ in range(iterations):
        await asyncio.sleep(0)
    in_time = task.cancel()
    with suppress(asyncio.CancelledError):
        await task
    return in_time


# --- the verbs ---------------------------------------------------------------------------------


async def test_setpoints_are_plain_methods_that_write_at_once(place: Place) -> None:
    async with place.opening() as robot:
        place.device.forget()
        robot.set_velocity(0.2, 1.0, ttl=0.3)
        robot.set_wheel_velocity(0.1, 0.2)
        robot.set_duty(-1.0, 0.5)
        first, second, third = place.device.obeyed  # without an iteration of the loop
        assert isinstance(first, SetWheelVelocity)
        assert (first.left_mps, first.right_mps) == pytest.approx((0.1, 0.3))
        assert isinstance(second, SetWheelVelocity)
        assert isinstance(third, SetDuty)


async def test_the_port_is_opened_by_await_as_well(place: Place) -> None:
    robot = await place.opening()
    assert "open" in repr(robot)
    await robot.close()
    assert not place.is_open
    await robot.close()
    for name, call in {**CALLS, **STOPS}.items():
        ends = StopAsyncIteration if name == "samples" else errors.LinkClosed
        with pytest.raises(ends):
            await call(robot)
    with pytest.raises(errors.LinkClosed):
        robot.set_velocity(0.1, 0.0)


async def test_all_parameters_are_known_without_waiting(place: Place) -> None:
    gain = PARAMETER_BY_NAME["integral_gain"]
    async with place.opening() as robot:
        parameters = robot.parameters
        asked = place.device.count(ParameterGet)
        assert set(parameters) == set(PARAMETER_BY_NAME)
        assert parameters["wheel_radius"] == 0.033
        assert dict(parameters)["integral_gain"] == gain.default
        assert parameters.get("integral_gian") is None
        assert place.device.count(ParameterGet) == asked
        assert await parameters.set("integral_gain", 7.5) == 7.5
        assert parameters["integral_gain"] == 7.5
        assert {info.name: info.value for info in await parameters.list()} == dict(parameters)
        await parameters.reset()
        assert parameters["integral_gain"] == gain.default


async def test_requests_of_several_tasks_are_each_answered(place: Place) -> None:
    async with place.opening() as robot:
        names = list(PARAMETER_BY_NAME)
        await asyncio.gather(*[robot.parameters.refresh(name) for name in names])
        await drive(place, robot)
        with pytest.raises(errors.DeviceRefused, match=r"ttl_max_s = 0\.5"):
            await robot.parameters.set("ttl_max_s", 0.5)


async def test_two_robots_share_a_loop() -> None:
    first, second = Place(), Place()
    async with first.opening() as one, second.opening() as two:
        await asyncio.gather(drive(first, one), drive(second, two))
        await one.stop()
        assert first.state() is SupervisorState.IDLE
        assert second.state() is SupervisorState.DRIVING
    assert second.state() is SupervisorState.IDLE
    assert other_tasks() == []


def test_another_thread_is_refused(place: Place) -> None:
    def attempt(robot: aio.Driver) -> None:
        plain: tuple[Callable[[], object], ...] = (
            lambda: robot.set_velocity(0.1, 0.0),
            lambda: robot.set_duty(0.1, 0.1),
            lambda: setattr(robot, "on_lost", print),
            robot.samples,
        )
        for call in plain:
            with pytest.raises(errors.InvalidCommand, match="another thread"):
                call()
        for name, awaited in {**CALLS, **STOPS}.items():
            with pytest.raises(errors.InvalidCommand, match="another"):
                asyncio.run(_of(awaited, robot))
            assert name
        assert robot.is_open  # what only looks may be asked for by anybody
        assert robot.statistics.sessions == 1

    async def use() -> None:
        async with place.opening() as robot:
            place.device.received.clear()
            await asyncio.to_thread(attempt, robot)
            assert place.device.count(SetWheelVelocity) == 0
            await robot.stop()

    asyncio.run(use())


async def _of(call: Call, robot: aio.Driver) -> object:
    return await call(robot)


async def test_calls_leave_time_for_the_loops_other_tasks() -> None:
    calls = LoopCalls(asyncio.get_running_loop())
    end = time.monotonic() + 2
    passed: list[float] = []

    def call() -> None:
        if not passed and time.monotonic() < end:
            calls.add(call)  # it never runs out of calls

    call()
    await asyncio.sleep(0.01)
    passed.append(time.monotonic())
    assert passed[0] < end


async def test_a_call_that_fails_holds_up_no_other() -> None:
    loop = asyncio.get_running_loop()
    told: list[object] = []
    loop.set_exception_handler(lambda _loop, context: told.append(context["message"]))
    calls = LoopCalls(loop)
    called: list[str] = []

    def fail() -> None:
        raise ZeroDivisionError

    calls.add(fail)
    calls.add(partial(called.append, "the next"))
    await until(lambda: called)
    assert len(told) == 1


async def test_virtual_time_passes_while_a_coroutine_waits() -> None:
    async with aio.open_driver("mock", realtime=False) as robot:
        lost: list[object] = []
        robot.on_lost = lost.append
        samples = robot.samples()
        sample = await anext(samples)
        while min(sample.left_mps, sample.right_mps) < 0.15:
            robot.set_velocity(0.2, 0.0, ttl=0.5)
            sample = await anext(samples)
        await robot.stop()
        assert await robot.parameters.set("integral_gain", 7.5) == 7.5
        assert robot.parameters["integral_gain"] == 7.5
        assert set(robot.parameters) == set(PARAMETER_BY_NAME)
        robot.advance(10.0)
        before = (await robot.read()).stamp
        assert before > 10
        robot.unplug()
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(anext(robot.samples()), 0.05)
        await until(lambda: lost)
        with pytest.raises(errors.LinkLost):
            await robot.stop()
        robot.plug()
        assert (await robot.read(5.0)).stamp > before
        assert robot.sessions == 2


async def test_a_fault_is_cleared_and_recorded() -> None:
    async with aio.open_driver("mock", realtime=False) as robot:

        async def drive_for_ever() -> None:
            while True:
                robot.set_velocity(0.2, 0.0, ttl=0.5)
                await robot.read()

        robot.simulator.set("left.encoder_dead", 1)
        with pytest.raises(errors.DeviceRefused, match="LEFT_NOT_COUNTING"):
            await drive_for_ever()
        robot.simulator.set("left.encoder_dead", 0)
        robot.advance(2.0)  # what is recorded is read at rest
        await robot.clear_fault()
        assert (await robot.recorder.ledger()).stops[SupervisorEvent.FAULT] == 1
        assert (await robot.recorder.read()).ledger is not None


# --- cancellation ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CALLS)
async def test_a_call_that_is_cancelled_anywhere_leaves_nothing_behind(
    place: Place, name: str
) -> None:
    async with place.opening() as robot:
        tasks, files = other_tasks(), open_files()
        iterations = 0
        while iterations < MOST_ITERATIONS:
            if name not in ("save", "reset", "set"):  # only while stopped
                await drive(place, robot)
            if not await cancelled_after(iterations, CALLS[name](robot)):
                break
            if name not in ("clear_estop", "clear_fault", "save", "reset", "set"):
                assert place.state() is SupervisorState.DRIVING
            assert other_tasks() == tasks
            assert not opened_since(files)
            await asyncio.wait_for(robot.parameters.refresh("wheel_radius"), 5)
            iterations += 1
        assert iterations > 0
        assert robot.sessions == 1
        await asyncio.wait_for(robot.stop(), 5)


@pytest.mark.parametrize("name", STOPS)
async def test_a_stop_that_is_cancelled_does_not_stop_what_drives_later(
    place: Place, name: str
) -> None:
    async with place.opening() as robot:
        iterations = 0
        while True:
            await drive(place, robot)
            place.device.mute = iterations % 2 == 1  # then it would be repeated for a second
            in_time = await cancelled_after(iterations, STOPS[name](robot))
            place.device.mute = False
            if not in_time:
                break
            if place.device.supervisor is SupervisorState.ESTOPPED:
                await robot.clear_estop()
                robot.set_velocity(0.0, 0.0)  # a clear alone restarts nothing
            iterations += 1
        assert iterations > 1
        if name == "estop":
            await robot.clear_estop()
            robot.set_velocity(0.0, 0.0)
        await drive(place, robot)
        await asyncio.sleep(0.1)
        assert place.state() is SupervisorState.DRIVING


async def test_a_change_that_is_cancelled_is_still_heard_of(place: Place) -> None:
    async with place.opening() as robot:
        await robot.parameters.list()
        iterations = 0
        while not place.device.count(ParameterSet):
            iterations += 1
            await cancelled_after(iterations, robot.parameters.set("wheel_radius", 0.05))
        await robot.parameters.refresh("integral_gain")  # comes after it
        assert robot.parameters["wheel_radius"] == 0.05
        assert robot.geometry.wheel_radius == 0.05


async def test_a_trial_that_is_cancelled_anywhere_is_reverted(place: Place) -> None:
    async def attempt(robot: aio.Driver) -> None:
        async with robot.parameters.trial():
            await robot.parameters.set("integral_gain", 7.5)
            await robot.parameters.set("integral_gain", 8.5)

    async with place.opening() as robot:
        await robot.parameters.list()
        cancelled = 0
        # All of them: on a busy computer the answers to a whole trial can come within one.
        for iterations in range(MOST_ITERATIONS):
            cancelled += await cancelled_after(iterations, attempt(robot))
            await robot.parameters.refresh("integral_gain")  # comes after what it has sent
            assert robot.parameters["integral_gain"] == 16.0
        assert cancelled > 3
        assert robot.sessions == 1
        await attempt(robot)  # the next one is not refused


def numbers() -> list[int]:
    """Iterations after which opening is cancelled: it takes some hundreds, and a thread."""
    found = [0]
    while found[-1] < 100_000:
        found.append(found[-1] + 1 + found[-1] // 4)
    return found


async def test_an_opening_that_is_cancelled_anywhere_leaves_nothing_behind(place: Place) -> None:
    await (await place.opening()).close()  # the executor's own descriptors
    files = open_files()
    for iterations in numbers():
        opening = asyncio.ensure_future(open_and_close(place))
        in_time = await cancelled_after(iterations, opening)
        await until(lambda: not place.is_open and not other_tasks())
        await until(lambda: not opened_since(files))
        if not in_time:
            return
    pytest.fail("it never opened")


async def open_and_close(place: Place) -> None:
    robot = await place.opening()
    await robot.close()


async def test_a_closing_that_is_cancelled_goes_on(place: Place) -> None:
    for iterations in range(MOST_ITERATIONS):
        robot = await place.opening()
        await drive(place, robot)
        closing = robot.close()
        if not await cancelled_after(iterations, closing):
            return
        if iterations == 0:
            await robot.close()  # it was cancelled before it began
        await until(lambda: not place.is_open and not other_tasks())
        assert place.state() is SupervisorState.IDLE
        await robot.close()


@pytest.mark.parametrize("by", [ZeroDivisionError, asyncio.CancelledError])
async def test_leaving_the_block_stops_the_robot(place: Place, by: type[BaseException]) -> None:
    drives = asyncio.Event()

    async def leave() -> None:
        async with place.opening() as robot:
            await drive(place, robot)
            drives.set()
            if by is ZeroDivisionError:
                raise ZeroDivisionError
            await asyncio.Event().wait()

    leaving = asyncio.ensure_future(leave())
    await drives.wait()
    if by is asyncio.CancelledError:
        leaving.cancel()
    with pytest.raises(by):
        await leaving
    assert place.state() is SupervisorState.IDLE
    assert not place.is_open
    assert other_tasks() == []


# --- the end of a loop -------------------------------------------------------------------------


def test_a_loop_that_dies_stops_the_robot(place: Place) -> None:
    robots = []

    async def use() -> None:
        robots.append(await place.opening())
        await drive(place, robots[0])
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        asyncio.run(use())
    assert place.state() is SupervisorState.IDLE
    assert not place.is_open
    with pytest.raises(errors.LinkClosed):
        robots[0].set_velocity(0.1, 0.0)


@pytest.mark.parametrize("is_woken", [False, True])
def test_a_loop_that_is_closed_without_a_word_closes_the_port(
    place: Place, *, is_woken: bool
) -> None:
    """Also when it was woken for a task that refers to the robot, and has not run since."""
    files = open_files()
    loop = asyncio.new_event_loop()
    loop.set_exception_handler(lambda _loop, _context: None)  # it tells of the pending task
    robots = [loop.run_until_complete(asyncio.wait_for(place.opening(), 10))]
    if is_woken:
        reading = loop.create_task(_read_forever(robots[0]))
        loop.run_until_complete(asyncio.sleep(0.1))
        del reading
    loop.run_until_complete(loop.shutdown_default_executor())
    if is_woken:
        calls = LoopCalls.of(loop)
        wait_until(lambda: calls._is_woken)
        del calls
    loop.close()
    robots.clear()
    del loop

    def is_closed() -> bool:
        gc.collect()  # again: the link's thread may be amid a call that holds the robot
        return not place.is_open

    wait_until(is_closed)
    wait_until(lambda: not opened_since(files))


async def _read_forever(robot: aio.Driver) -> None:
    async for _ in robot.samples():
        pass


async def test_a_forgotten_robot_is_stopped(place: Place) -> None:
    robots = [await place.opening()]
    await drive(place, robots[0])
    robots.clear()
    gc.collect()
    await until(lambda: not other_tasks())
    assert place.state() is SupervisorState.IDLE
    assert not place.is_open


# --- the port and its loss ---------------------------------------------------------------------


async def test_an_unplugged_port_is_opened_again_when_it_is_back(device: PtyDevice) -> None:
    async with aio.open_driver("serial", str(device.path)) as robot:
        samples = robot.samples()
        await anext(samples)
        gain = robot.parameters["integral_gain"]
        device.unplug()
        await until(lambda: not robot.is_open)
        with pytest.raises(errors.LinkLost):
            robot.set_velocity(0.1, 0.0)
        for call in (robot.stop, robot.get_encoder_ticks, partial(robot.read, 0.05)):
            with pytest.raises(errors.LinkLost):
                await call()
        with pytest.raises(errors.LinkLost):
            robot.parameters["integral_gain"]
        device.device.parameters["integral_gain"] = gain / 2
        device.device.reset()
        device.plug()
        assert (await robot.read(10)).boot_id == device.device.boot_id
        assert robot.parameters["integral_gain"] == gain / 2
        assert robot.sessions == 2
        assert robot.statistics.reconnects == 1
        async for sample in samples:  # it has waited
            if sample.boot_id == device.device.boot_id:
                break
        robot.set_velocity(0.0, 0.0)
        robot.set_velocity(0.1, 0.0)


def test_importing_it_opens_nothing_and_imports_no_driver() -> None:
    code = (
        "import ctypes, os, sys\n"  # libffi 3.5 keeps its own file open
        "before = os.listdir('/proc/self/fd'); import wheelwire.aio\n"
        "assert os.listdir('/proc/self/fd') == before\n"
        "slow = {'serial', 'numpy', 'yaml', 'gpiozero', 'pigpio', 'rclpy', 'typer'}\n"
        "assert not slow & set(sys.modules), slow & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
