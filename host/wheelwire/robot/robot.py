"""A robot with every verb, for threads: by a link, or by a driver of another package.

`wheelwire.aio` has its twin for asyncio.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import SimpleNamespace
from typing import TYPE_CHECKING, NoReturn, TypeVar, cast

from ..arguments import timeout_s
from ..errors import DriverUnavailable, InvalidCommand, RequestTimeout
from ..link.device_link import DeviceLink
from ..link.sample_stream import LatestSample, SampleIterator
from ..link.traffic import Happening, Listener
from ..samples import ImuSample, InputsSample, PowerSample, WheelSample
from .callbacks import Inbox, InlineCallbacks, ThreadCallbacks, check_plain
from .calls import Requests, blocking
from .verbs import Questions, Verbs, WaitingVerbs

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from ..log.recorder import Recorder
    from ..log.why.diagnosis import Stop
    from ..log.why.watch import StopWatch
    from ..parameters import Parameters
    from .black_boxes import DeviceRecorder
    from .board import DeviceBoard
    from .sensors import Ranges, Sensor, Sensors

FIRST_SAMPLE_S = 1.0

RobotT = TypeVar("RobotT", bound="Robot")
_opened_later: ContextVar[bool] = ContextVar("opened_later", default=False)
_only_looks: ContextVar[bool] = ContextVar("only_looks", default=False)


@contextmanager
def opened_later() -> Iterator[None]:
    """A robot that is made inside this does not open its link: its maker does."""
    before = _opened_later.set(True)
    try:
        yield
    finally:
        _opened_later.reset(before)


@contextmanager
def opened_to_look() -> Iterator[None]:
    """A robot made inside this is not armed: its program does not drive."""
    before = _only_looks.set(True)
    try:
        yield
    finally:
        _only_looks.reset(before)


class Robot(Verbs, Questions):
    """A robot with two driven wheels.

    A setpoint is valid for its `ttl` and no longer; the library never renews one. Methods may be
    called from any thread and in a signal handler, whatever it interrupts: each returns within its
    timeout, or raises an error of `wheelwire.errors`. Used as a context manager, a robot is stopped
    at the exit.

    All methods that reach the robot raise `LinkLost` while it is out of reach, and `LinkClosed`
    once it is closed.

    Args:
        make_link: Makes the link to its device, which puts samples into the argument. The robot
            opens and closes it. None: a driver of another package reaches its robot in another way,
            and defines all of `OWN`. Any other method that it does not define raises
            `DriverUnavailable`.

    Raises:
        TypeError: There is no link, and the driver lacks one of `OWN`.
    """

    _callbacks: ThreadCallbacks | InlineCallbacks

    def __init__(self, make_link: Callable[[LatestSample], DeviceLink] | None = None) -> None:
        latest_sample = LatestSample()
        if make_link is None:
            _check_own(type(self))
            link = cast("DeviceLink", _NoDevice())
        else:
            link = make_link(latest_sample)
        link.arms = not _only_looks.get()
        callbacks = InlineCallbacks() if link.in_virtual_time else ThreadCallbacks()
        super().__init__(Requests(link), latest_sample, callbacks)
        if not _opened_later.get():
            with self._explanations:
                link.open()
            self._learn_limits()
        inbox = callbacks.inbox if isinstance(callbacks, ThreadCallbacks) else None
        # Also runs when the robot is garbage-collected, and at the interpreter's exit.
        self._finalizer: weakref.finalize[..., Robot] = weakref.finalize(self, _close, inbox, link)
        self._awaited = WaitingVerbs(self._requests)
        self._sensors: Sensors | None = None
        self._recorders: list[Recorder] = []

    # --- stopping ------------------------------------------------------------------------------

    stop = blocking(WaitingVerbs.stop)
    estop = blocking(WaitingVerbs.estop)
    clear_estop = blocking(WaitingVerbs.clear_estop)
    clear_fault = blocking(WaitingVerbs.clear_fault)

    def close(self) -> None:
        """Same as `shutdown`; the name that files and sockets use."""
        # The `shutdown` of another package's driver knows nothing of callbacks and iterators.
        self._callbacks.close()
        self._latest_sample.close()
        self.shutdown()
        self._callbacks.wait()

    def shutdown(self) -> None:
        """Stop the robot, close the port, end the thread. Safe to call more than once."""
        self._callbacks.close()
        # First: iterators then end, instead of raising that the link is closed.
        self._latest_sample.close()
        # Not by the finalizer: if interrupted, it would do nothing the next time.
        self._link.close()
        for recorder in self._recorders:
            recorder.close()
        self._finalizer.detach()
        self._callbacks.wait()

    def __enter__(self: RobotT) -> RobotT:
        if self._link.has_ended:
            self._check_link()  # raises why
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- measuring -----------------------------------------------------------------------------

    def read(self, timeout: float = 1.0) -> WheelSample:
        """Return the newest unread sample, waiting for one if necessary.

        A sample that was left unread for 0.1 s, or for two periods of a slower stream, is too old:
        this waits for the next one. It also waits through a reconnection if `timeout` [s], at most
        an hour, is long enough. Of several threads that wait, each gets the next sample.

        Raises:
            InvalidArgument: The timeout is not a valid number.
            LinkLost: The robot was still out of reach after `timeout`.
            LinkClosed: The robot was closed, or its link has failed.
            RequestTimeout: The robot is in reach, but sent no new sample.
        """
        timeout = timeout_s("timeout", timeout)
        try:
            return self._latest_sample.take(timeout)
        except RequestTimeout:
            # Out of reach is the better explanation, if that is why nothing came.
            self._check_link()
            raise

    def samples(self) -> SampleIterator[WheelSample]:
        """All samples from now on, for `for sample in robot.samples():`.

        Each iterator has a queue of its own that holds one second of samples; its `dropped` counts
        those that were not taken in time. It waits while the robot is out of reach, however long,
        and ends when the robot is closed.
        """
        return self._latest_sample.iterate()

    def get_encoder_ticks(self) -> tuple[int, int]:
        """(left, right) ticks of the newest sample, forward positive, without bounds.

        They continue across wraps of the device's counters and across its resets.

        Raises:
            LinkLost: The robot is out of reach.
            RequestTimeout: The robot is in reach, but sends no samples.
        """
        # First: a lost robot is reported at once, and not after the wait.
        self._check_link()
        try:
            return self._latest_sample.ticks(FIRST_SAMPLE_S)
        except RequestTimeout:
            self._check_link()  # it may have been lost during the wait
            raise

    @property
    def sensors(self) -> Sensors:
        """All sensors of the robot; `DriverUnavailable` if its driver has none."""
        if not self.has_device:
            raise DriverUnavailable(f"the driver of {self._name} has no sensors: use another")
        if self._sensors is None:
            from .sensors import Sensors  # here, as below: many programs only drive

            self._sensors = Sensors(self._requests, self._latest_sample)
        return self._sensors

    @property
    def imu(self) -> Sensor[ImuSample]:
        """The robot's gyroscope and accelerometer."""
        return self.sensors.imu

    @property
    def power(self) -> Sensor[PowerSample]:
        """The robot's supply: a power sensor, or the battery's divider."""
        return self.sensors.power

    @property
    def inputs(self) -> Sensor[InputsSample]:
        """The robot's inputs: bumpers, cliff sensors, fault outputs of power stages, voltages."""
        return self.sensors.inputs

    @property
    def ranges(self) -> Ranges:
        """The robot's range sensors, by name."""
        return self.sensors.ranges

    # --- the device ----------------------------------------------------------------------------

    @property
    def has_device(self) -> bool:
        """As `Verbs.has_device`."""
        return not isinstance(self._link, _NoDevice)

    @property
    def parameters(self) -> Parameters:
        """The device's parameters, by name: a mapping of the values known in this session."""
        from .parameters import DeviceParameters  # here, as above

        # One for all threads, whichever asks first.
        parameters: Parameters = vars(self).setdefault(
            "_parameters", DeviceParameters(self._requests)
        )
        return parameters

    @property
    def board(self) -> DeviceBoard:
        """The board that the device has stored."""
        from .board import DeviceBoard

        return DeviceBoard(self._requests)

    @property
    def recorder(self) -> DeviceRecorder:
        """What the device has recorded of its stops."""
        from .black_boxes import DeviceRecorder

        return DeviceRecorder(self._requests)

    # --- what is recorded and reported ---------------------------------------------------------

    def record(self, path: str | Path, driver: str | None = None) -> Recorder:
        """Record all that crosses the link from now on, until the robot is closed.

        Args:
            path: The file; a folder: a file in it that is named by the time. No file is
                overwritten: the new one's name gets a number.
            driver: What the file calls the driver; its class by default.

        Raises:
            InvalidCommand: The robot is in virtual time, or is a recording.
            RecordingError: The file cannot be made, or the package `mcap` is not installed.
        """
        from ..tools.record import start  # here, for most programs record nothing

        recorder = start(self._link, path, driver or type(self).__name__)
        self._recorders.append(recorder)
        return recorder

    def watch_stops(self, report: Callable[[Stop], object]) -> StopWatch:
        """Report each stop of the robot with its cause, until the robot is closed.

        Until then, errors that the robot raises have the same sentence in `why`.

        Args:
            report: Called some 60 ms after a stop, up to 1.2 s after one by a sensor, in a thread
                of its own, which logs what it raises. `error` of the watch says why it has ended.

        Raises:
            InvalidArgument: `report` is not a plain function.
            InvalidCommand: The robot is in virtual time, or is a recording.
        """
        from ..log.why.watch import StopWatch  # here, for most programs ask for none

        check_plain("watch_stops", report)
        if self._link.in_virtual_time:
            raise InvalidCommand(f"{self._link.name}: only a robot in real time can be watched")
        self._explanations.watch = watch = StopWatch(self._link, report)
        return watch


BaseDriver = Robot
"""The same class, by the name that authors of drivers know it by."""

OWN = (
    *("stop", "estop", "clear_estop", "clear_fault", "shutdown"),
    *("parameters", "geometry", "statistics"),
    *("_drive_velocity", "_drive_duty", "_check_link"),
)
"""What a driver without a link defines."""


def _check_own(driver: type[Robot]) -> None:
    missing = [name for name in OWN if getattr(driver, name) is getattr(Robot, name)]
    if missing:
        raise TypeError(
            f"{driver.__name__} has no link to a device and lacks {', '.join(missing)}: define "
            "them, or give it a link, as `wheelwire.drivers.transport.TransportDriver` does"
        )


class _MissingError(DriverUnavailable, AttributeError):
    """Also an AttributeError, so that `hasattr(robot, "info")` says whether there is a device."""


class _NoDevice:
    """Replaces the link for a driver without one; it knows of no device."""

    arms = False
    in_virtual_time = False
    has_ended = False
    name = "robot"
    hold = None
    rolling_mps = None
    reported = SimpleNamespace(watched_values=None)

    def open(self) -> None:
        """There is nothing to open."""

    def close(self) -> None:
        """The driver closes what it has opened."""

    def asked(self, _now_us: int) -> None:
        """Not known."""

    def note(self, _what: Mapping[str, object]) -> None:
        """Nothing is recorded."""

    def listen(self, _listener: Listener, happening: Happening) -> None:
        """Refuse: this robot cannot report stops.

        Raises:
            InvalidCommand: Always.
        """
        raise InvalidCommand(
            f"{self.name} does not report {happening.name} by itself: ask `is_open` and `read`"
        )

    def __getattr__(self, name: str) -> NoReturn:
        raise _MissingError(
            f"the driver of this robot reaches no Wheelwire device, which {name} needs: name "
            "another robot"
        )


def _close(inbox: Inbox | None, link: DeviceLink) -> None:
    if inbox is not None:
        inbox.close()
    link.close()
