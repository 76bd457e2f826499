"""The drivers for asyncio: a facade over `wheelwire.open_driver`, whose link has a thread.

async with wheelwire.aio.connect("/dev/ttyUSB0") as robot:
    async for sample in robot.samples():
        robot.set_velocity(0.2, 0.0, ttl=0.3)
        print(sample)

Each method does what its namesake of `wheelwire.BaseDriver` does, and raises the same errors. What
waits for the robot is a coroutine. A robot belongs to the loop that it was opened in: only that
loop, and its thread, may use it.
"""

from __future__ import annotations

import asyncio
import threading
import weakref
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Generator, Mapping
from contextlib import AbstractAsyncContextManager, suppress
from functools import partial
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
from .drivers.device_board import BoardOperations, BoardSteps
from .drivers.device_parameters import (
    REVERT,
    ParameterOperations,
    checked_timeout,
    contradiction_error,
    run,
)
from .drivers.factory import check_options, driver_class
from .drivers.linked import LinkedRobot
from .drivers.loop_callbacks import LoopCallbacks
from .errors import DeviceRefused, DriverUnavailable, InvalidCommand, LinkLost, WheelwireError
from .link.connection import (
    CALL_TIMEOUT_S,
    CLOSE_TIMEOUT_S,
    Link,
    call_takes_too_long,
)
from .link.latest_sample import LatestSample
from .link.news import Happening
from .link.requests import Answer, Done, RequestMessage
from .link.sample_iterator import SampleIterator as _SampleQueue
from .link.waiting import Notifier
from .motion.kinematics import WheelVelocities
from .parameters import TRIAL_TIMEOUT_S, ParameterInfo, ParameterMapping
from .samples import WheelSample

# For type checkers alone: importing this module loads no driver, pin library or simulator.
if TYPE_CHECKING:
    import os
    from pathlib import Path

    from wheelwire_protocol.board import BoardState

    from .board import BoardDescription
    from .drivers.mock import MockDriver as _SyncMockDriver
    from .drivers.pins import PinDriver as _SyncPinDriver
    from .drivers.transport_driver import DeviceDriver
    from .simulation.library import FwSim
    from .simulation.simulator import Simulator
    from .simulation.virtual_link import VirtualLink

__all__ = [
    "Board",
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

_VIRTUAL_STEP_S = 0.001


class _LoopLink:
    """A link, and the loop that waits for it.

    The link's thread wakes the loop, by one call for all that has happened until the loop runs it.
    Where time is virtual there is no such thread, and waiting makes time pass.
    """

    def __init__(self, robot: DeviceDriver) -> None:
        self.link = robot._link
        self.latest_sample: LatestSample = robot._latest_sample
        self._virtual = None if isinstance(self.link, Link) else self.link
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread = 0
        self._calls: deque[Callable[[], None]] = deque()
        self._is_woken = False
        self._guard: asyncio.Task[None] | None = None

    # --- opening and closing ---------------------------------------------------------------------

    async def open(self) -> None:
        """Open the link, which belongs to the running loop from now on."""
        self._loop = asyncio.get_running_loop()
        self._thread = threading.get_ident()
        link = self.link
        if not isinstance(link, Link):
            link.open()
            return
        # All are watched, so that each has a value without waiting: no subscript can be awaited.
        link.watch([definition.id for definition in PARAMETERS])
        self._guard = self._loop.create_task(
            _guard(link, self.wait_for), name=f"wheelwire {link.name}"
        )
        try:
            for ready, timeout_s in link.opening():
                await self.wait_for(link.changed, ready, timeout_s)
        except BaseException:
            # A cancellation, too: the thread would go on serving a port that nobody can close.
            await self.close()
            raise

    async def close(self) -> None:
        """Stop the robot and close the port; when this is cancelled, a moment later."""
        link, guard = self.link, self._guard
        if not isinstance(link, Link):
            link.close()
            return
        link.finish()
        if guard is not None and guard.get_loop() is asyncio.get_running_loop():
            # To await the task itself would cancel it along with the caller.
            await asyncio.wait([guard], timeout=CLOSE_TIMEOUT_S)

    def abandon(self) -> None:
        """Nobody uses the link any more: stop the robot, without keeping a loop waiting."""
        if isinstance(self.link, Link) and self._loop is not None and self._loop.is_running():
            self.link.finish()
        else:
            self.link.close()

    def check_thread(self) -> None:
        """Raise `InvalidCommand` in another thread than the loop's."""
        if threading.get_ident() != self._thread and not self.link.has_ended:
            raise InvalidCommand(
                "the robot belongs to an asyncio loop of another thread: have that loop call it, "
                "by loop.call_soon_threadsafe or asyncio.run_coroutine_threadsafe"
            )

    # --- waiting ---------------------------------------------------------------------------------

    def call_in_loop(self, call: Callable[[], None]) -> None:
        """Have the loop call it; from any thread."""
        self._calls.append(call)
        if not self._is_woken and self._loop is not None:
            self._is_woken = True
            try:
                self._loop.call_soon_threadsafe(self._run_calls)
            except RuntimeError:  # the loop is closed
                self._is_woken = False
                self._calls.clear()

    def _run_calls(self) -> None:
        self._is_woken = False  # first: what comes from now on wakes the loop once more
        while self._calls:
            self._calls.popleft()()

    async def wait_for(
        self, changed: Notifier, ready: Callable[[], bool], timeout_s: float | None = None
    ) -> bool:
        """Wait until `ready()`, which `changed` tells of, or for `timeout_s`; returns whether."""
        loop = self._own_loop()
        if self._virtual is not None:
            return await _pass_until(self._virtual, ready, timeout_s)
        end_s = None if timeout_s is None else loop.time() + timeout_s
        while not ready():
            if end_s is not None and loop.time() >= end_s:
                return False
            waiter = _Waiter(loop.create_future(), self.call_in_loop)
            changed.add(waiter)
            # It ends the same wait: when time is up, `ready` is asked once more, too.
            timer = None if end_s is None else loop.call_at(end_s, waiter.end)
            try:
                # What changed before it was added wakes nobody.
                if not ready():
                    await waiter.future
            finally:
                changed.discard(waiter)
                if timer is not None:
                    timer.cancel()
        return True

    async def call(self, post: Callable[[Done], None]) -> Answer:
        """Have `post` send a request; wait for its result, and return or raise it.

        When this is cancelled the request is withdrawn.
        """
        self._own_loop()
        results: list[Answer | WheelwireError] = []
        answered = Notifier()

        def done(result: Answer | WheelwireError) -> None:
            results.append(result)
            answered.notify_all()

        post(done)
        try:
            await self.wait_for(answered, lambda: bool(results), CALL_TIMEOUT_S)
        except BaseException:
            # A late copy would be carried out after whatever the program does next.
            self.link.withdraw(done)
            raise
        if not results:
            self.link.withdraw(done)
            raise call_takes_too_long()
        # The same error may end many calls: tracebacks must not pile up in it.
        if isinstance(results[0], WheelwireError):
            raise results[0].with_traceback(None)
        return results[0]

    async def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer."""
        return await self.call(partial(self.link.post, message))

    async def run(self, steps: BoardSteps[Result]) -> Result:
        """Do an operation by requests that are awaited, one after the other."""
        try:
            # A request's error ends the operation where it is: its generator has nothing to clean
            # up.
            step = next(steps)
            while True:
                if isinstance(step, float):
                    await asyncio.sleep(step)
                    step = next(steps)
                else:
                    step = steps.send(await self._answer(step))
        except StopIteration as end:
            # The operation is over, and this is what its generator returned.
            return cast("Result", end.value)

    async def _answer(self, message: RequestMessage) -> Answer:
        try:
            return await self.request(message)
        except DeviceRefused as error:
            if error.code != RefusalCode.CONTRADICTION:
                raise
            found = cast("Contradictions", await self.request(ContradictionsGet(0, 0)))
            raise contradiction_error(message, found) from None

    def _own_loop(self) -> asyncio.AbstractEventLoop:
        loop = asyncio.get_running_loop()
        # Of a link that has ended, whoever asks learns that.
        if loop is not self._loop and not self.link.has_ended:
            raise InvalidCommand(
                "the robot belongs to another asyncio loop: use it in the one that opened it, as "
                "by asyncio.run_coroutine_threadsafe"
            )
        return loop


class _Waiter:
    """A coroutine that waits for another thread's news."""

    def __init__(
        self, future: asyncio.Future[None], call_in_loop: Callable[[Callable[[], None]], None]
    ) -> None:
        self.future = future
        self._call_in_loop = call_in_loop

    def release(self) -> None:
        """End the wait; from any thread."""
        self._call_in_loop(self.end)

    def end(self) -> None:
        """End the wait; in the loop."""
        if not self.future.done():
            self.future.set_result(None)


async def _pass_until(
    link: VirtualLink, ready: Callable[[], bool], timeout_s: float | None
) -> bool:
    """Let virtual time pass until `ready()`, or for `timeout_s`; returns whether it was ready."""
    end_us = None if timeout_s is None else link.now_us + round(timeout_s * 1e6)
    while not ready():
        if end_us is not None and link.now_us >= end_us:
            return False
        link.advance(_VIRTUAL_STEP_S)
        await asyncio.sleep(0)  # others have the loop meanwhile, and this may be cancelled
    return True


async def _guard(link: Link, wait_for: Callable[..., Awaitable[bool]]) -> None:
    """The link's task: a loop that ends cancels it, and waits until the robot is stopped."""
    try:
        while not link.has_ended:
            try:
                await wait_for(link.changed, lambda: link.has_ended)
            except asyncio.CancelledError:  # noqa: PERF203 - it goes on waiting
                link.finish()
    except GeneratorExit:  # the loop was closed without a word, and this is thrown away
        link.close()
        raise


class Driver(LinkedRobot):
    """A robot with two driven wheels, on the running loop. Made by `connect` and `open_driver`.

    `set_velocity`, `set_wheel_velocity`, `set_duty` and the properties are plain: they wait for
    nothing. Cancelling a coroutine withdraws what it has asked for: no copy of it is sent any more.
    What was sent before may have been carried out. Used as an asynchronous context manager, it
    stops the robot at the exit.

    All methods that reach the robot raise `LinkLost` while it is out of reach, and `LinkClosed`
    once the driver is closed.

    Args:
        robot: The driver that is used; made by `opened_later`.
    """

    def __init__(self, robot: DeviceDriver) -> None:
        self._robot = robot
        self._link = robot._link
        self._latest_sample = robot._latest_sample
        self._on_loop = on_loop = _LoopLink(robot)
        self._callbacks: LoopCallbacks = LoopCallbacks(on_loop.call_in_loop)
        self._parameters = Parameters(on_loop)
        # In place of the driver's own, which waits.
        robot._finalizer.detach()
        self._finalizer = weakref.finalize(self, on_loop.abandon)

    async def stop(self) -> None:
        """Stop both wheels and wait for the acknowledgement.

        Raises:
            LinkLost: There is no session; the stop was sent if the port is there.
            RequestTimeout: It was not acknowledged; the setpoint's deadline acts.
        """
        await self._on_loop.call(self._link.post_stop)

    async def estop(self) -> None:
        """Stop both wheels and latch; otherwise as `stop`."""
        await self._on_loop.call(self._link.post_estop)

    async def clear_estop(self) -> None:
        """End the emergency stop; `DeviceRefused` while its cause lasts."""
        await self._on_loop.request(ClearEstop(0, 0))

    async def clear_fault(self) -> None:
        """Clear the latched faults; `DeviceRefused` while their cause lasts."""
        await self._on_loop.request(ClearFault(0, 0))

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
        latest = self._latest_sample
        taken: WheelSample | None = None

        def take() -> bool:
            nonlocal taken
            if taken is None:  # asked again after the wait: it must not take a second one
                taken = latest.poll()
            return taken is not None

        # The end of the link ends the wait, too: `poll` then raises its reason.
        await self._on_loop.wait_for(latest.changed, take, timeout)
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
        self._on_loop.check_thread()
        return SampleIterator(self._on_loop)

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
            self._check_link()  # it may have been lost meanwhile
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

    async def device_counters(self) -> LinkCounters:
        """What the device has counted at its end of the link since its reset."""
        return cast("LinkCounters", await self._on_loop.request(LinkCountersGet(0, 0)))

    async def contradictions(self) -> Contradiction:
        """Which active parameters contradict each other, or the board: nothing drives meanwhile."""
        answer = cast("Contradictions", await self._on_loop.request(ContradictionsGet(0, 0)))
        return Contradiction(answer.active)

    async def control_counters(self) -> ControlCounters:
        """What the device's control loop and encoders have counted since its reset."""
        return cast("ControlCounters", await self._on_loop.request(ControlCountersGet(0, 0)))

    async def close(self) -> None:
        """Stop the robot and release all resources. Safe to call more than once.

        When it is cancelled, the robot is stopped and the port closed all the same.
        """
        self._callbacks.close()
        # First: iterators then end, instead of raising that the link is closed.
        self._latest_sample.close()
        await self._on_loop.close()
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
        await self._on_loop.open()

    def _listen(self, happening: Happening) -> None:
        self._on_loop.check_thread()
        super()._listen(happening)

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        self._on_loop.check_thread()
        super()._drive_velocity(wheels, expiry_us)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        self._on_loop.check_thread()
        super()._drive_duty(left, right, expiry_us)

    def _now_us(self) -> int:
        return self._robot._now_us()


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


class SampleIterator(AsyncIterator[WheelSample]):
    """As `wheelwire.SampleIterator`, for `async for`."""

    def __init__(self, on_loop: _LoopLink) -> None:
        # Polled, and waited for on the loop: its own `next` would block the thread.
        self._queue: _SampleQueue = on_loop.latest_sample.iterate()
        self._on_loop = on_loop

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
            await self._on_loop.wait_for(self._on_loop.latest_sample.changed, self._queue.is_ready)


class Parameters(ParameterMapping):
    """The parameters of one robot: a mapping of the newest values that it reported.

    All of them are read whenever a session is opened, so using the mapping never waits. A change
    that was cancelled or not answered (`RequestTimeout`) may have been made or not; `refresh`
    tells.

    Raises, in every coroutine: `LinkLost`, `RequestTimeout`, `DeviceRefused`; in every one that
    takes a name: `UnknownParameter`.
    """

    def __init__(self, on_loop: _LoopLink) -> None:
        self._operations = ParameterOperations(on_loop.link)
        self._on_loop = on_loop

    async def set(self, name: str, value: float) -> float:
        """Change a value until the next reset of the device; returns the active value.

        Raises:
            ParameterOutOfRange: Beyond the bounds, not finite, or not whole where it must be.
        """
        return await self._on_loop.run(self._operations.set(name, value))

    async def refresh(self, name: str | None = None) -> None:
        """Ask the device anew for one value, or for all."""
        await self._on_loop.run(self._operations.refresh(name))

    async def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters, with the bounds that the device holds them to."""
        return await self._on_loop.run(self._operations.list())

    async def save(self, name: str | None = None) -> None:
        """Keep values across resets: one, or all. Only while stopped."""
        await self._on_loop.run(self._operations.save(name))

    async def reset(self) -> None:
        """Go back to the defaults, and forget what was saved. Only while stopped."""
        await self._on_loop.run(self._operations.reset())

    def trial(self, timeout: float = TRIAL_TIMEOUT_S) -> Trial:
        """Try values: `async with robot.parameters.trial() as trial: ...; await trial.keep()`.

        As `wheelwire.Parameters.trial`.
        """
        return Trial(self._operations, self._on_loop, checked_timeout(timeout))

    def _value(self, definition: Parameter) -> float:
        value = self._operations.newest(definition.id)
        if value is not None:
            return value
        link = self._on_loop.link
        if isinstance(link, Link):  # a new session has just begun
            raise LinkLost("a new session is being opened; wait a moment")
        return run(self._operations.get(definition.id), link.request)  # in virtual time


class Trial(AbstractAsyncContextManager["Trial"]):
    """A trial of parameters, made by `Parameters.trial`; as `wheelwire.parameters.Trial`."""

    def __init__(
        self, operations: ParameterOperations, on_loop: _LoopLink, timeout_s: float
    ) -> None:
        self._operations = operations
        self._on_loop = on_loop
        self._timeout_s = timeout_s
        self._kept = False

    async def keep(self) -> None:
        """Leave the values active until the next reset of the device; ends the trial.

        Raises:
            DeviceRefused: The trial was lost; the previous values are active.
            RequestTimeout: Nobody knows whether the device kept the values.
        """
        await self._on_loop.run(self._operations.keep_trial())
        # Only once it is acknowledged: until then the end of the block has to revert.
        self._kept = True

    async def __aenter__(self) -> Trial:
        try:
            await self._on_loop.run(self._operations.begin_trial(self._timeout_s))
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
        # After a KEEP the session has released the trial already.
        if self._kept:
            return
        try:
            await self._on_loop.run(self._operations.revert_trial())
        except WheelwireError:
            if error is None:  # else that one says more
                raise
        except BaseException:  # cancelled: what was asked for is not repeated any more
            self._abandon()
            raise
        finally:
            self._on_loop.link.release_trial()

    def _abandon(self) -> None:
        # Not awaited: the task may be ending. If it cannot be sent, the device reverts by itself.
        with suppress(WheelwireError):
            self._on_loop.link.post(REVERT, lambda _: None)
        self._on_loop.link.release_trial()


class Board:
    """The board of one device, as `wheelwire.drivers.device_board.DeviceBoard`."""

    def __init__(self, on_loop: _LoopLink) -> None:
        self._operations = BoardOperations(on_loop.link)
        self._run = on_loop.run

    async def read(self) -> tuple[BoardState, BoardDescription | None]:
        """Whether the active board was confirmed, and the board; None if there is none."""
        return await self._run(self._operations.read())

    async def write(self, board: BoardDescription) -> None:
        """Store a board, to be tried at the next restart."""
        await self._run(self._operations.write(board))

    async def confirm(self, board: BoardDescription) -> None:
        """Save the board that is on trial, or the firmware's own, and let it drive."""
        await self._run(self._operations.confirm(board))

    async def accept(self, board: BoardDescription) -> None:
        """Confirm the active board, and wait until the device drives on it."""
        await self._run(self._operations.accept(board))

    async def take_up(self, board: BoardDescription) -> None:
        """Write a board, restart the device, and confirm the board if it comes back on it."""
        await self._run(self._operations.take_up(board))

    async def restart(self) -> None:
        """Restart the device, and wait until it is back."""
        await self._run(self._operations.restart())


class Opening(Awaitable[DriverT], AbstractAsyncContextManager[DriverT], Generic[DriverT]):
    """What `connect` and `open_driver` return: for `await`, or `async with`, which also closes."""

    def __init__(self, make: Callable[[], DriverT]) -> None:
        self._make = make
        self._made: DriverT | None = make()  # at once: that checks the options
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
    name, options = driver_at(named(robot))
    return open_driver(name, **options)


_DRIVERS: dict[str, type[Driver]] = {"l298n": PinDriver, "mock": MockDriver, "pigpio": PinDriver}
"""Name -> what offers more than `Driver`."""


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
    realtime: bool = ...,
    parameters: Mapping[str, float] | None = ...,
    store: Path | None = ...,
) -> Opening[MockDriver]: ...
@overload
def open_driver(name: str, **options: Any) -> Opening[Driver]: ...
def open_driver(name: str, **options: Any) -> Opening[Any]:
    """Open a robot by the name of its driver: by `async with`, which closes it too, or `await`.

    The options are checked at once, without opening anything.

    Args:
        name: As for `wheelwire.open_driver`.
        **options: As those of `wheelwire.open_driver`.

    Raises:
        DriverUnavailable: No driver has this name, or what it needs is not installed or not there,
            or it has no link.
        InvalidArgument: The driver has no such option, or needs one that is missing.
        WheelwireError: What the driver itself raises.
    """
    from .drivers.transport_driver import DeviceDriver, opened_later  # here: it can read boards

    driver = driver_class(name)
    check_options(name, driver, options)

    def make() -> Driver:
        with opened_later():
            robot = driver(**options)
        if not isinstance(robot, DeviceDriver):
            robot.close()
            raise DriverUnavailable(
                f"driver {name!r} has no link that asyncio could wait for: use "
                "wheelwire.open_driver"
            )
        return _DRIVERS.get(name, Driver)(robot)

    return Opening(make)
