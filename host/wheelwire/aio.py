"""The drivers for asyncio: a facade over those of `wheelwire.open_driver`.

async with wheelwire.aio.connect("/dev/ttyUSB0") as robot:
    async for sample in robot.samples():
        robot.set_velocity(0.2, 0.0, ttl=0.3)
        print(sample)

Each method does what its namesake of `wheelwire.Robot` does, and raises the same errors.
Methods that wait for the robot are coroutines. A robot belongs to the loop that it was opened in:
only that loop, and its thread, may use it.
"""

from __future__ import annotations

import asyncio
import threading
import weakref
from collections.abc import AsyncIterator, Awaitable, Callable, Generator
from contextlib import AbstractAsyncContextManager
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar, cast, overload

from .arguments import timeout_s
from .errors import DriverUnavailable
from .link.sample_stream import SampleIterator as _SampleQueue
from .link.traffic import Happening
from .motion.kinematics import WheelVelocities
from .robot.black_boxes import AwaitableRecorder as DeviceRecorder
from .robot.board import AwaitableBoard as Board
from .robot.loop_callbacks import LoopCallbacks
from .robot.loop_link import LoopLink
from .robot.parameters import AwaitableParameters as Parameters
from .robot.parameters import AwaitableTrial as Trial
from .robot.robot import FIRST_SAMPLE_S, Robot, opened_later
from .robot.sensors import (
    DEFAULT_RATE_HZ,
    OF_IMU,
    OF_INPUTS,
    OF_POWER,
    KnownRanges,
    KnownSensor,
    KnownSensors,
    Streams,
)
from .robot.verbs import Verbs, WaitingVerbs
from .samples import (
    EVENTS,
    RANGE,
    ImuSample,
    InputsSample,
    PowerSample,
    RangeSample,
    SensorEvent,
    WheelSample,
)

# For type checkers alone: importing this module loads no driver, pin library or simulator.
if TYPE_CHECKING:
    import os
    from pathlib import Path

    from .drivers.arguments import (
        L298NArguments,
        MockArguments,
        PigpioArguments,
        ReplayArguments,
        SerialArguments,
        arguments_of,
    )
    from .drivers.mock import MockDriver as _SyncMockDriver
    from .drivers.pins import PinDriver as _SyncPinDriver
    from .errors import RecordingError, WheelwireError
    from .log.recorder import Recorder as _SyncRecorder
    from .log.why.diagnosis import Stop
    from .log.why.watch import StopWatch as _SyncStopWatch
    from .simulation.libfwsim import FwSim
    from .simulation.simulator import Simulator

__all__ = [
    "Board",
    "Driver",
    "MockDriver",
    "Parameters",
    "PinDriver",
    "Ranges",
    "Recorder",
    "SampleIterator",
    "Sensor",
    "Sensors",
    "StopWatch",
    "Trial",
    "connect",
    "open_driver",
]

DriverT = TypeVar("DriverT", bound="Driver")
ClosingT = TypeVar("ClosingT", bound="_Closing")
ResultT = TypeVar("ResultT")
SampleT = TypeVar("SampleT")
SensorSampleT = TypeVar("SensorSampleT", ImuSample, PowerSample, InputsSample)


class Driver(WaitingVerbs, Verbs):
    """A robot with two driven wheels, on the running loop. Made by `connect` and `open_driver`.

    `set_velocity`, `set_wheel_velocity`, `set_duty` and the properties are plain: they wait for
    nothing. Cancelling a coroutine withdraws its request: no more copies are sent, but the robot
    may have carried out an earlier one. Used as an asynchronous context manager, it stops the robot
    at the exit.

    All methods that reach the robot raise `LinkLost` while it is out of reach, and `LinkClosed`
    once the driver is closed.

    Args:
        robot: The driver that is used; made by `opened_later`.
    """

    _callbacks: LoopCallbacks

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._on_loop = on_loop = LoopLink(robot)
        callbacks = LoopCallbacks(on_loop.call_in_loop)
        Verbs.__init__(self, on_loop, robot._latest_sample, callbacks)
        self._now_us = robot._now_us
        self._parameters = Parameters(on_loop)
        self._sensors = Sensors(on_loop)
        # Replaces the driver's own, which waits.
        robot._finalizer.detach()
        self._finalizer = weakref.finalize(self, on_loop.abandon)
        self._recording: Callable[[], None] | None = None
        """Begins what `open_driver` was asked to record."""
        self._watches: list[StopWatch] = []

    async def read(self, timeout: float = 1.0) -> WheelSample:
        """Return the newest unread sample, waiting for one if necessary.

        A sample that was left unread for 0.1 s, or for two periods of a slower stream, is too old:
        this waits for the next one. It also waits through a reconnection if `timeout` [s], at most
        an hour, is long enough. Of several tasks that wait, each gets the next sample.

        Raises:
            InvalidArgument: The timeout is not a valid number.
            LinkLost: The robot was still out of reach after `timeout`.
            LinkClosed: The driver was closed, or its link has failed.
            RequestTimeout: The robot is in reach, but sent no new sample.
        """
        timeout = timeout_s("timeout", timeout)
        latest = self._latest_sample
        taken: WheelSample | None = None
        since_us = latest.now_us()

        def take() -> bool:
            nonlocal taken
            if taken is None:  # checked again after the wait: it must not take a second sample
                taken = latest.poll(since_us)
            return taken is not None

        # The end of the link ends the wait, too: `poll` then raises its reason.
        await self._on_loop.wait_for(latest.changed, take, timeout)
        if taken is None:
            # Out of reach is the better explanation, if that is why nothing came.
            self._check_link()
            raise self._latest_sample.why_none(timeout)
        return taken

    def samples(self) -> SampleIterator[WheelSample]:
        """All samples from now on, for `async for sample in robot.samples():`.

        Each iterator has a queue of its own that holds one second of samples; its `dropped` counts
        those that were not taken in time. It waits while the robot is out of reach, however long,
        and ends when the driver is closed.
        """
        self._on_loop.check_thread()
        return SampleIterator(self._on_loop, self._latest_sample.iterate())

    async def get_encoder_ticks(self) -> tuple[int, int]:
        """(left, right) ticks of the newest sample, forward positive, without bounds.

        They continue across wraps of the device's counters and across its resets.

        Raises:
            LinkLost: The robot is out of reach.
            RequestTimeout: The robot is in reach, but sends no samples.
        """
        self._check_link()
        latest, link = self._latest_sample, self._link
        # A link that has ended brings no sample: waiting on would only delay its error.
        await self._on_loop.wait_for(
            latest.changed, lambda: latest.is_current or link.has_ended, FIRST_SAMPLE_S
        )
        if not latest.is_current:
            self._check_link()  # it may have been lost during the wait
            raise latest.why_none(FIRST_SAMPLE_S)
        # Without a time-out: to wait in there would block the loop.
        return latest.ticks(0)

    @property
    def parameters(self) -> Parameters:
        """The device's parameters, by name: a mapping of their values in this session."""
        return self._parameters

    @property
    def board(self) -> Board:
        """The board that the device has stored."""
        return Board(self._on_loop)

    @property
    def recorder(self) -> DeviceRecorder:
        """What the device has recorded of its stops."""
        return DeviceRecorder(self._on_loop)

    @property
    def sensors(self) -> Sensors:
        """All sensors of the robot."""
        return self._sensors

    @property
    def imu(self) -> Sensor[ImuSample]:
        """The robot's gyroscope and accelerometer."""
        return self._sensors.imu

    @property
    def power(self) -> Sensor[PowerSample]:
        """The robot's supply: a power sensor, or the battery's divider."""
        return self._sensors.power

    @property
    def inputs(self) -> Sensor[InputsSample]:
        """The robot's inputs: bumpers, cliff sensors, fault outputs of power stages, voltages."""
        return self._sensors.inputs

    @property
    def ranges(self) -> Ranges:
        """The robot's range sensors, by name."""
        return self._sensors.ranges

    async def close(self) -> None:
        """Stop the robot and release all resources. Safe to call more than once.

        When it is cancelled, the robot is still stopped and the port closed.
        """
        self._callbacks.close()
        for watch in self._watches:
            watch._callbacks.close()
        # First: iterators then end, instead of raising that the link is closed.
        self._latest_sample.close()
        await self._on_loop.close()
        for recorder in self._robot._recorders:
            await asyncio.to_thread(recorder.close)
        for watch in self._watches:
            await watch.close()
        await self._callbacks.wait()
        # Skipped when this is cancelled: the finaliser stays, and finishing twice is harmless.
        self._finalizer.detach()

    async def __aenter__(self: DriverT) -> DriverT:
        if self._link.has_ended:
            self._check_link()  # raises why
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def record(self, path: str | Path, driver: str | None = None) -> Recorder:
        """As `wheelwire.SerialDriver.record`; when this is cancelled, nothing is recorded."""
        begin = partial(self._robot.record, path, driver)
        return Recorder(await _in_thread(begin, lambda recorder: recorder.close()))

    async def watch_stops(self, report: Callable[[Stop], object]) -> StopWatch:
        """As every driver's; `report` is called in the loop, and may be a coroutine.

        Stops are found in a thread of their own. Each report is awaited before the next one.

        Args:
            report: Called some 60 ms after a stop, up to 1.2 s after one by a sensor. What it
                raises is logged.

        Raises:
            InvalidArgument: `report` cannot be called.
            InvalidCommand: The robot is in virtual time, or is a recording.
        """
        self._on_loop.check_thread()
        callbacks = LoopCallbacks(self._on_loop.call_in_loop)
        callbacks.set(Happening.STOPPED, report)
        listener = callbacks.listener

        def begin() -> _SyncStopWatch:
            return self._robot.watch_stops(lambda stop: listener((Happening.STOPPED, stop)))

        try:
            begun = await _in_thread(begin, lambda late: late.close())
        except asyncio.CancelledError:
            callbacks.close()
            raise
        watch = StopWatch(begun, callbacks)
        self._watches.append(watch)
        return watch

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        self._on_loop.check_thread()
        super()._drive_velocity(wheels, expiry_us)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        self._on_loop.check_thread()
        super()._drive_duty(left, right, expiry_us)

    async def _open(self) -> None:
        await self._on_loop.open()
        self._learn_limits()
        if self._recording is not None:
            try:
                await asyncio.to_thread(self._recording)
            except BaseException:
                await self.close()
                raise


class PinDriver(Driver):
    """A robot on this computer's pins, or behind a pigpio daemon."""

    _robot: _SyncPinDriver

    @property
    def limits(self) -> tuple[str, ...]:
        """What this wiring cannot do, in sentences; logged once as warnings."""
        return self._robot.limits


class MockDriver(Driver):
    """A simulated robot. In virtual time, it passes while a coroutine waits, and in `advance`."""

    _robot: _SyncMockDriver

    @property
    def simulator(self) -> Simulator | FwSim:
        """What a driver cannot know: the truth, and faults to inject, by `get` and `set`."""
        return self._robot.simulator

    def advance(self, seconds: float) -> None:
        """Let virtual time pass; `InvalidCommand` if time is real."""
        self._robot.advance(seconds)

    def unplug(self) -> None:
        """The robot is out of reach from now on."""
        self._robot.unplug()

    def plug(self) -> None:
        """It is back in reach, in real time a moment later."""
        self._robot.plug()


async def _in_thread(begin: Callable[[], ResultT], undo: Callable[[ResultT], object]) -> ResultT:
    """Begin something that is slow to import and waits for the robot; undone when cancelled."""
    begun: list[ResultT] = []
    withdrawn = threading.Event()

    def in_thread() -> None:
        begun.append(begin())
        if withdrawn.is_set():
            undo(begun[0])

    try:
        await asyncio.to_thread(in_thread)
    except asyncio.CancelledError:
        # The thread goes on. Whichever of the two finishes last undoes what the thread began.
        withdrawn.set()
        for late in begun:
            await asyncio.to_thread(undo, late)
        raise
    return begun[0]


class _Closing:
    """What `async with` closes."""

    async def close(self) -> None:
        raise NotImplementedError

    async def __aenter__(self: ClosingT) -> ClosingT:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()


class Recorder(_Closing):
    """Records a robot until it is closed, or this is; made by `Driver.record`."""

    def __init__(self, recorder: _SyncRecorder) -> None:
        self._recorder = recorder

    @property
    def file(self) -> Path:
        """The file that is being written, or was last."""
        return self._recorder.file

    @property
    def files(self) -> list[Path]:
        """All that were written, in order; of the last one more may come."""
        return self._recorder.files

    @property
    def lost(self) -> int:
        """Records that came faster than they could be written."""
        return self._recorder.lost

    @property
    def error(self) -> RecordingError | None:
        """Why the recording has ended before the link."""
        return self._recorder.error

    async def close(self) -> None:
        """Write what is left and the file's end. Safe to call more than once."""
        await asyncio.to_thread(self._recorder.close)


class StopWatch(_Closing):
    """Watches a robot for stops; made by `Driver.watch_stops`."""

    def __init__(self, watch: _SyncStopWatch, callbacks: LoopCallbacks) -> None:
        self._watch = watch
        self._callbacks = callbacks

    @property
    def error(self) -> WheelwireError | None:
        """Why it has ended before the link."""
        return self._watch.error

    def latched(self) -> Stop | None:
        """The stop that keeps the robot from driving now, also before it is reported."""
        return self._watch.latched()

    async def close(self) -> None:
        """Watch no more, and wait a moment for a report that runs. Safe to call more than once."""
        self._callbacks.close()
        await asyncio.to_thread(self._watch.close)
        await self._callbacks.wait()


class SampleIterator(AsyncIterator[SampleT]):
    """As `wheelwire.SampleIterator`, for `async for`."""

    def __init__(
        self,
        on_loop: LoopLink,
        queue: _SampleQueue[SampleT],
        begin: Callable[[], Awaitable[object]] | None = None,
    ) -> None:
        # Polled, and waited for on the loop: its own `next` would block the thread.
        self._queue = queue
        self._on_loop = on_loop
        self._begin = begin
        """What has to be asked for first, once."""

    @property
    def dropped(self) -> int:
        """Samples that were not taken in time."""
        return self._queue.dropped

    async def __anext__(self) -> SampleT:
        """The next sample.

        Raises:
            StopAsyncIteration: The driver was closed.
            WheelwireError: The link has ended otherwise, or what is asked for first has failed.
        """
        if self._begin is not None:
            await self._begin()
            self._begin = None
        while True:
            try:
                sample = self._queue.poll()
            except StopIteration:
                # A coroutine that let it pass would raise RuntimeError instead.
                raise StopAsyncIteration from None
            if sample is not None:
                return sample
            await self._on_loop.wait_for(self._on_loop.latest_sample.changed, self._queue.is_ready)


class Sensor(KnownSensor[SensorSampleT]):
    """One sensor of a robot, or all its inputs together. See `wheelwire.Sensor`."""

    async def read(self, timeout: float = 1.0) -> SensorSampleT:
        """As `wheelwire.Sensor.read`."""
        return await self._read(timeout)

    def samples(self) -> SampleIterator[SensorSampleT]:
        """As `wheelwire.Sensor.samples`, for `async for`; errors come with the first sample."""
        return _iterator(self._streams, self._name, self._begin)


class Ranges(KnownRanges):
    """The range sensors of a robot, by name. See `wheelwire.Ranges`."""

    async def read(self, name: str, timeout: float = 1.0) -> RangeSample:
        """As `wheelwire.Ranges.read`."""
        return await self._read(name, timeout)

    def samples(self) -> SampleIterator[RangeSample]:
        """As `wheelwire.Ranges.samples`, for `async for`; errors come with the first sample."""
        return _iterator(self._streams, RANGE, self._begin)


class Sensors(KnownSensors):
    """All sensors of a robot. See `wheelwire.Sensors`."""

    def __init__(self, on_loop: LoopLink) -> None:
        super().__init__(on_loop, on_loop.latest_sample)
        self.imu: Sensor[ImuSample] = Sensor(self._streams, *OF_IMU)
        self.power: Sensor[PowerSample] = Sensor(self._streams, *OF_POWER)
        self.inputs: Sensor[InputsSample] = Sensor(self._streams, *OF_INPUTS)
        self.ranges = Ranges(self._streams)

    async def start(self, rate_hz: int = DEFAULT_RATE_HZ) -> None:
        """As `wheelwire.Sensors.start`."""
        await self._streams.start_at(rate_hz)

    def events(self) -> SampleIterator[SensorEvent]:
        """As `wheelwire.Sensors.events`, for `async for`; errors come with the first event."""
        return _iterator(self._streams, EVENTS, self._streams.begin)


def _iterator(
    streams: Streams, key: str, begin: Callable[[], Awaitable[object]]
) -> SampleIterator[Any]:
    on_loop = cast("LoopLink", streams.requests)
    on_loop.check_thread()
    return SampleIterator(on_loop, streams.latest.iterate_sensor(key), begin)


class Opening(Awaitable[DriverT], AbstractAsyncContextManager[DriverT], Generic[DriverT]):
    """Opens a driver when it is awaited; `async with` also closes it."""

    def __init__(self, make: Callable[[], DriverT]) -> None:
        self._make = make
        self._made: DriverT | None = make()  # at once: that checks the options
        self._robot: DriverT | None = None

    def __await__(self) -> Generator[Any, None, DriverT]:
        return self._open().__await__()

    async def __aenter__(self) -> DriverT:
        self._robot = await self._open()
        return self._robot

    async def __aexit__(self, *_: object) -> None:
        if self._robot is not None:
            await self._robot.close()

    async def _open(self) -> DriverT:
        robot, self._made = self._made or self._make(), None
        await robot._open()
        return robot


def connect(robot: str | os.PathLike[str] | None = None) -> Opening[Driver]:
    """Open a robot by its address: by `async with`, which closes it too, or `await`.

    As `wheelwire.connect`. A robot's file is read at once, without opening anything.

    Args:
        robot: See `wheelwire.connect`.

    Raises:
        WheelwireError: As `wheelwire.connect`.
    """
    from .connect import driver_at, named

    name, options = driver_at(named(robot))
    return open_driver(name, **options)


_DRIVERS: dict[str, type[Driver]] = {"l298n": PinDriver, "mock": MockDriver, "pigpio": PinDriver}
"""Name -> what offers more than `Driver`."""


if TYPE_CHECKING:

    @overload
    @arguments_of(SerialArguments)
    def open_driver(name: Literal["serial"]) -> Opening[Driver]: ...
    @overload
    @arguments_of(L298NArguments)
    def open_driver(name: Literal["l298n"]) -> Opening[PinDriver]: ...
    @overload
    @arguments_of(PigpioArguments)
    def open_driver(name: Literal["pigpio"]) -> Opening[PinDriver]: ...
    @overload
    @arguments_of(MockArguments)
    def open_driver(name: Literal["mock"]) -> Opening[MockDriver]: ...
    @overload
    @arguments_of(ReplayArguments)
    def open_driver(name: Literal["replay"]) -> Opening[Driver]: ...
    @overload
    def open_driver(name: str, *args: Any, record: str | Path | None = None) -> Opening[Driver]: ...


def open_driver(
    name: str, *args: Any, record: str | Path | None = None, **options: Any
) -> Opening[Any]:
    """Open a robot by the name of its driver: by `async with`, which closes it too, or `await`.

    The options are checked at once, without opening anything.

    Args:
        name: As for `wheelwire.open_driver`.
        *args: As those of `wheelwire.open_driver`.
        record: As that of `wheelwire.open_driver`.
        **options: As those of `wheelwire.open_driver`.

    Raises:
        DriverUnavailable: No driver has this name, or what it needs is not installed or not there,
            or it has no link.
        InvalidArgument: The driver has no such option, or needs one that is missing.
        WheelwireError: What the driver itself raises.
    """
    from .connect import check_options, driver_class, record_opened, wanted_recording

    driver = driver_class(name)
    check_options(name, driver, options, *args)
    recording = wanted_recording(record)

    def make() -> Driver:
        with opened_later():
            robot: Robot = driver(*args, **options)
        if not robot.has_device:
            robot.close()
            raise DriverUnavailable(
                f"driver {name!r} has no link that asyncio could wait for: use "
                "wheelwire.open_driver"
            )
        made = _DRIVERS.get(name, Driver)(robot)
        if recording is not None:
            is_asked = record is not None
            made._recording = partial(record_opened, robot, recording, name, is_asked=is_asked)
        return made

    return Opening(make)
