"""The drivers for asyncio, without a thread.

async with wheelwire.aio.connect("/dev/ttyUSB0") as robot:
    async for sample in robot.samples():
        robot.set_velocity(0.2, 0.0, ttl=0.3)
        print(sample)

Each method does what its namesake of `wheelwire.BaseDriver` does, and raises the same errors. What
waits for the robot is a coroutine. A robot belongs to the loop that it was opened in, and
only its thread may use it.
"""

from __future__ import annotations

import weakref
from collections.abc import AsyncIterator, Awaitable, Callable, Generator, Mapping
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import replace
from importlib import import_module
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar, cast, overload

from wheelwire_protocol.codes import Contradiction, RefusalCode
from wheelwire_protocol.parameters import PARAMETERS, Parameter
from wheelwire_protocol.types import (
    ClearEstop,
    ClearFault,
    Contradictions,
    ContradictionsGet,
    ControlCounters,
    ControlCountersGet,
    LinkCounters,
    LinkCountersGet,
)

from .arguments import timeout_s
from .config import driver_at, named
from .drivers.base import FIRST_SAMPLE_S
from .drivers.device_parameters import (
    REVERT,
    ParameterOperations,
    Steps,
    checked_timeout,
    contradiction_error,
)
from .drivers.factory import check_options
from .drivers.linked import LinkedRobot
from .drivers.loop_callbacks import LoopCallbacks
from .errors import (
    DeviceRefused,
    DriverUnavailable,
    InvalidArgument,
    LinkLost,
    WheelwireError,
    shown,
)
from .link.async_connection import AsyncLink
from .link.base_link import LinkOptions
from .link.latest_sample import ITERATOR_WAIT_S, LatestSample
from .link.requests import Answer, RequestMessage
from .link.sample_iterator import SampleIterator as _SampleQueue
from .parameters import TRIAL_TIMEOUT_S, ParameterInfo, ParameterMapping
from .samples import WheelSample

# For type checkers alone: importing this module loads no driver, pin library or simulator.
if TYPE_CHECKING:
    import os
    from pathlib import Path

    from .board import BoardDescription
    from .drivers.mock import MockProcess
    from .linux_mcu.settings import McuSettings
    from .simulation.simulator import Simulator

__all__ = [
    "Driver",
    "MockDriver",
    "Parameters",
    "PinDriver",
    "SampleIterator",
    "Trial",
    "connect",
    "open_driver",
]

Result = TypeVar("Result")
DriverT = TypeVar("DriverT", bound="Driver")


class Driver(LinkedRobot):
    """A robot with two driven wheels, on the running loop. Made by `connect` and `open_driver`.

    `set_velocity`, `set_wheel_velocity`, `set_duty` and the properties are plain: they wait for
    nothing. Cancelling a coroutine withdraws what it has asked for: no copy of it is sent any more.
    What was sent before may have been carried out. Used as an asynchronous context manager, it
    stops the robot at the exit.

    All methods that reach the robot raise `LinkLost` while it is out of reach, and `LinkClosed`
    once the driver is closed.
    """

    def __init__(self, options: LinkOptions) -> None:
        self._latest_sample = LatestSample()
        self._callbacks: LoopCallbacks = LoopCallbacks()
        # All are watched, so that each has a value without waiting: no subscript can be awaited.
        everything = tuple(definition.id for definition in PARAMETERS)
        self._link: AsyncLink = AsyncLink(replace(options, watched=everything), self._latest_sample)
        self._parameters = Parameters(self._link)
        # When it is forgotten, the robot is stopped, as far as the loop still runs.
        self._finalizer = weakref.finalize(self, self._link.finish)

    async def stop(self) -> None:
        """Stop both wheels and wait for the acknowledgement.

        Raises:
            LinkLost: There is no session; the stop was sent if the port is there.
            RequestTimeout: It was not acknowledged; the setpoint's deadline acts.
        """
        await self._link.stop()

    async def estop(self) -> None:
        """Stop both wheels and latch; otherwise as `stop`."""
        await self._link.estop()

    async def clear_estop(self) -> None:
        """End the emergency stop; `DeviceRefused` while its cause lasts."""
        await self._link.request(ClearEstop(0, 0))

    async def clear_fault(self) -> None:
        """Clear the latched faults; `DeviceRefused` while their cause lasts."""
        await self._link.request(ClearFault(0, 0))

    async def read(self, timeout: float = 1.0) -> WheelSample:
        """Return the newest unread sample, waiting for one if necessary.

        One that was left unread for 0.1 s, or for two periods of a slower stream, is not returned:
        the next one is waited for. Waits through a reconnection if `timeout` [s], at most an hour,
        is long enough.

        Raises:
            InvalidArgument: The timeout is not a valid number.
            LinkLost: The robot was still out of reach after `timeout`.
            LinkClosed: The driver was closed, or its link has failed.
            RequestTimeout: The robot is in reach, but sent no new sample.
        """
        timeout = timeout_s("timeout", timeout)
        taken: WheelSample | None = None

        def take() -> bool:
            nonlocal taken
            taken = self._latest_sample.poll()
            return taken is not None

        # The end of the link ends the wait, too: `poll` then raises its reason.
        await self._link.changed.wait_for(take, timeout)
        if taken is None:
            # Out of reach is the better explanation, if that is why nothing came.
            self._check_link()
            raise self._latest_sample.why_none(timeout)
        return taken

    def samples(self) -> SampleIterator:
        """All samples from now on, for `async for sample in robot.samples():`.

        Each iterator has a queue of its own that holds one second of samples; its `dropped` counts
        those that were not taken in time. It waits while the robot is out of reach, however long,
        and ends when the driver is closed.
        """
        return SampleIterator(self._latest_sample, self._link)

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
        await link.changed.wait_for(lambda: latest.is_current or link.has_ended, FIRST_SAMPLE_S)
        if not latest.is_current:
            self._check_link()  # it may have been lost meanwhile
            raise latest.why_none(FIRST_SAMPLE_S)
        # Without a time-out: to wait in there would block the loop.
        return latest.ticks(0)

    @property
    def parameters(self) -> Parameters:
        """The device's parameters, by name: a mapping of their values in this session."""
        return self._parameters

    async def device_counters(self) -> LinkCounters:
        """What the device has counted at its end of the link since its reset."""
        return cast("LinkCounters", await self._link.request(LinkCountersGet(0, 0)))

    async def contradictions(self) -> Contradiction:
        """Which active parameters contradict each other, or the board: nothing drives meanwhile."""
        answer = cast("Contradictions", await self._link.request(ContradictionsGet(0, 0)))
        return Contradiction(answer.active)

    async def control_counters(self) -> ControlCounters:
        """What the device's control loop and encoders have counted since its reset."""
        return cast("ControlCounters", await self._link.request(ControlCountersGet(0, 0)))

    async def close(self) -> None:
        """Stop the robot and release all resources. Safe to call more than once.

        When it is cancelled, the robot is stopped and the port closed all the same.
        """
        self._callbacks.close()
        # First: iterators then end, instead of raising that the link is closed.
        self._latest_sample.close()
        await self._link.close()
        await self._callbacks.wait()
        # Skipped when this is cancelled: the finaliser stays, and finishing twice is harmless.
        self._finalizer.detach()

    async def __aenter__(self: DriverT) -> DriverT:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        await self.close()

    async def _open(self) -> None:
        await self._link.open()


class PinDriver(Driver):
    """A robot on this computer's pins, or behind a pigpio daemon."""

    def __init__(self, settings: McuSettings) -> None:
        from .drivers.pins import PinProcess  # here: it starts processes, and few need it

        self._process = PinProcess(settings)
        super().__init__(self._process.options)

    @property
    def limits(self) -> tuple[str, ...]:
        """What this wiring cannot do, in sentences; logged once as warnings."""
        return self._process.limits


class MockDriver(Driver):
    """A simulated robot, in real time."""

    def __init__(self, process: MockProcess) -> None:
        self._process = process
        super().__init__(process.options)

    @property
    def simulator(self) -> Simulator:
        """What a driver cannot know: the truth, and faults to inject, by `get` and `set`."""
        return self._process.simulator

    def unplug(self) -> None:
        """The robot is out of reach from now on."""
        self._process.unplug()

    def plug(self) -> None:
        """It is back in reach, a moment later."""
        self._process.plug()


class SampleIterator(AsyncIterator[WheelSample]):
    """As `wheelwire.SampleIterator`, for `async for`."""

    def __init__(self, latest_sample: LatestSample, link: AsyncLink) -> None:
        # Polled, and waited for on the loop: its own `next` would block the thread.
        self._queue: _SampleQueue = latest_sample.iterate()
        self._link = link

    @property
    def dropped(self) -> int:
        """Samples that were not taken in time."""
        return self._queue.dropped

    async def __anext__(self) -> WheelSample:
        """The next sample.

        Raises:
            StopAsyncIteration: The driver was closed.
            WheelwireError: The link has ended otherwise.
        """
        while True:
            try:
                sample = self._queue.poll()
            except StopIteration:
                # A coroutine that let it pass would raise RuntimeError instead.
                raise StopAsyncIteration from None
            if sample is not None:
                return sample
            await self._link.changed.wait_for(self._queue.is_ready, ITERATOR_WAIT_S)


class Parameters(ParameterMapping):
    """The parameters of one robot: a mapping of the newest values that it reported.

    All of them are read whenever a session is opened, so using the mapping never waits. A change
    that was cancelled or not answered (`RequestTimeout`) may have been made or not; `refresh`
    tells.

    Raises, in every coroutine: `LinkLost`, `RequestTimeout`, `DeviceRefused`; in every one that
    takes a name: `UnknownParameter`.
    """

    def __init__(self, link: AsyncLink) -> None:
        self._operations = ParameterOperations(link)
        self._link = link

    async def set(self, name: str, value: float) -> float:
        """Change a value until the next reset of the device; returns the value in force.

        Raises:
            ParameterOutOfRange: Beyond the bounds, not finite, or not whole where it must be.
        """
        return await self._run(self._operations.set(name, value))

    async def refresh(self, name: str | None = None) -> None:
        """Ask the device anew for one value, or for all."""
        await self._run(self._operations.refresh(name))

    async def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters, with the bounds that the device holds them to."""
        return await self._run(self._operations.list())

    async def save(self, name: str | None = None) -> None:
        """Keep values across resets: one, or all. Only while stopped."""
        await self._run(self._operations.save(name))

    async def reset(self) -> None:
        """Go back to the defaults, and forget what was saved. Only while stopped."""
        await self._run(self._operations.reset())

    def trial(self, timeout: float = TRIAL_TIMEOUT_S) -> Trial:
        """Try values: `async with robot.parameters.trial() as trial: ...; await trial.keep()`.

        As `wheelwire.Parameters.trial`.
        """
        return Trial(self._operations, self._link, checked_timeout(timeout))

    def _value(self, definition: Parameter) -> float:
        value = self._operations.newest(definition.id)
        if value is None:  # a new session has just begun
            raise LinkLost("a new session is being opened; wait a moment")
        return value

    async def _run(self, steps: Steps[Result]) -> Result:
        return await _run(steps, self._link)


class Trial(AbstractAsyncContextManager["Trial"]):
    """A trial of parameters, made by `Parameters.trial`; as `wheelwire.parameters.Trial`."""

    def __init__(self, operations: ParameterOperations, link: AsyncLink, timeout_s: float) -> None:
        self._operations = operations
        self._link = link
        self._timeout_s = timeout_s
        self._kept = False

    async def keep(self) -> None:
        """Leave the values in force until the next reset of the device; ends the trial.

        Raises:
            DeviceRefused: The trial was lost; the former values are in force.
            RequestTimeout: Whether they were kept is not known.
        """
        await _run(self._operations.keep_trial(), self._link)
        # Only once it is acknowledged: until then the end of the block has to revert.
        self._kept = True

    async def __aenter__(self) -> Trial:
        try:
            await _run(self._operations.begin_trial(self._timeout_s), self._link)
        except DeviceRefused:
            raise  # none was begun; the other one goes on
        except BaseException:  # it may have been begun, and nobody will be there to end it
            self._abandon()
            raise
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        # Where it was kept, the session has released the trial already.
        if self._kept:
            return
        try:
            await _run(self._operations.revert_trial(), self._link)
        except WheelwireError:
            if error is None:  # else that one says more
                raise
        except BaseException:  # cancelled: what was asked for is not repeated any more
            self._abandon()
            raise
        finally:
            self._link.release_trial()

    def _abandon(self) -> None:
        # Not awaited: the task may be ending. If it cannot be sent, the device reverts by itself.
        with suppress(WheelwireError):
            self._link.post(REVERT)
        self._link.release_trial()


async def _run(steps: Steps[Result], link: AsyncLink) -> Result:
    """Do an operation by requests that are awaited, one after the other."""
    try:
        # A request's error ends the operation where it is: its generator has nothing to clean up.
        message = next(steps)
        while True:
            message = steps.send(await _answer(message, link))
    except StopIteration as end:
        # The operation is over, and this is what its generator returned.
        return cast("Result", end.value)


async def _answer(message: RequestMessage, link: AsyncLink) -> Answer:
    try:
        return await link.request(message)
    except DeviceRefused as error:
        if error.code != RefusalCode.CONTRADICTION:
            raise
        found = cast("Contradictions", await link.request(ContradictionsGet(0, 0)))
        raise contradiction_error(message, found) from None


class Opening(Awaitable[DriverT], AbstractAsyncContextManager[DriverT], Generic[DriverT]):
    """What `connect` and `open_driver` return: for `await`, or `async with`, which also closes."""

    def __init__(self, make: Callable[[], DriverT]) -> None:
        self._make = make
        self._robot: DriverT | None = None

    def __await__(self) -> Generator[Any, None, DriverT]:
        return self._open().__await__()

    async def __aenter__(self) -> DriverT:
        self._robot = await self._open()
        return self._robot

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._robot is not None:
            await self._robot.close()

    async def _open(self) -> DriverT:
        # Not before: the link belongs to the loop that runs when it is made.
        robot = self._make()
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
    name, options = driver_at(named(robot))
    return open_driver(name, **options)


_DRIVERS: dict[str, tuple[type[Driver], str, str]] = {
    "l298n": (PinDriver, "options", "L298NOptions"),
    "mock": (MockDriver, "mock", "MockProcess"),
    "pigpio": (PinDriver, "options", "PigpioDriverOptions"),
    "serial": (Driver, "options", "SerialDriverOptions"),
}
"""Name -> the class, and its options in which module of `drivers`."""


@overload
def open_driver(
    name: Literal["serial"],
    *,
    port: str,
    baud_rate: int = ...,
    connect_timeout: float = ...,
    stream_rate_hz: int | None = ...,
    board_id: str | None = ...,
    any_board: bool = ...,
    board: str | Path | BoardDescription | None = ...,
    parameters: Mapping[str, float] | None = ...,
) -> Opening[Driver]: ...
@overload
def open_driver(
    name: Literal["l298n"],
    *,
    pins: BoardDescription | None = ...,
    pwm_chip: int | None = ...,
    parameters: Mapping[str, float] | None = ...,
    store: Path | None = ...,
    pwm_directory: Path = ...,
    core_timeout_ms: int = ...,
) -> Opening[PinDriver]: ...
@overload
def open_driver(
    name: Literal["pigpio"],
    *,
    host: str = ...,
    port: int = ...,
    pins: BoardDescription | None = ...,
    parameters: Mapping[str, float] | None = ...,
    store: Path | None = ...,
    core_timeout_ms: int = ...,
) -> Opening[PinDriver]: ...
@overload
def open_driver(
    name: Literal["mock"],
    *,
    parameters: Mapping[str, float] | None = ...,
    store: Path | None = ...,
) -> Opening[MockDriver]: ...
@overload
def open_driver(name: str, **options: Any) -> Opening[Driver]: ...
def open_driver(name: str, **options: Any) -> Opening[Any]:
    """Open a robot by the name of its driver: by `async with`, which closes it too, or `await`.

    The options are checked at once, without opening anything.

    Args:
        name: `serial`, `l298n`, `pigpio` or `mock`.
        **options: As those of `wheelwire.open_driver`. `mock` has real time only.

    Raises:
        DriverUnavailable: No driver has this name, or what it needs is not installed or not there.
        InvalidArgument: The driver has no such option, or needs one that is missing.
        WheelwireError: What the driver itself raises.
    """
    if not isinstance(name, str) or name not in _DRIVERS:
        known = ", ".join(_DRIVERS)
        raise DriverUnavailable(
            f"no driver for asyncio is called {shown(name)}; there are: {known}"
        )
    driver, module, checks = _DRIVERS[name]
    # Taken out of the options: `MockProcess` has real time only, and no such argument.
    if name == "mock" and not options.pop("realtime", True):
        raise InvalidArgument(
            "driver 'mock': in virtual time, time passes while a call waits, which no asyncio loop "
            "does; leave out realtime=False, or use wheelwire.open_driver"
        )
    # By name: only the module of the chosen driver is imported, with what it needs.
    check: Any = getattr(import_module(f"{__package__}.drivers.{module}"), checks)
    check_options(name, check, options)
    made = check(**options)
    checked = made if name == "mock" else made.checked()
    return Opening(lambda: driver(checked))
