"""The common part of all drivers that reach their robot by the protocol over a byte stream."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, TypeVar

from ..errors import InvalidCommand
from ..link.device_link import DeviceLink
from ..link.sample_stream import LatestSample
from ..parameters import Parameters
from .base import BaseDriver
from .black_boxes import DeviceRecorder
from .board import DeviceBoard
from .callbacks import Inbox, InlineCallbacks, ThreadCallbacks, check_plain
from .calls import AwaitableDevice, Requests, blocking
from .linked import LinkedRobot
from .parameters import DeviceParameters
from .sensors import Sensors

if TYPE_CHECKING:
    from pathlib import Path

    from ..log.recorder import Recorder
    from ..log.why import Stop
    from ..log.why.watch import StopWatch

DriverT = TypeVar("DriverT", bound="DeviceDriver")
_opened_later: ContextVar[bool] = ContextVar("opened_later", default=False)
_only_looks: ContextVar[bool] = ContextVar("only_looks", default=False)


@contextmanager
def opened_later() -> Iterator[None]:
    """A driver that is made inside this does not open its link: its maker does."""
    before = _opened_later.set(True)
    try:
        yield
    finally:
        _opened_later.reset(before)


@contextmanager
def opened_to_look() -> Iterator[None]:
    """A driver that is made inside this does not arm its robot: whoever made it drives nothing."""
    before = _only_looks.set(True)
    try:
        yield
    finally:
        _only_looks.reset(before)


class DeviceDriver(LinkedRobot, BaseDriver):
    """A robot whose device is reached over a link.

    Args:
        make_link: Makes the link, which puts samples into the argument. The driver opens and
            closes it.
    """

    def __init__(self, make_link: Callable[[LatestSample], DeviceLink]) -> None:
        BaseDriver.__init__(self)
        link = make_link(self._latest_sample)
        link.arms = not _only_looks.get()
        LinkedRobot.__init__(self, Requests(link))
        if link.in_virtual_time:
            self._callbacks = InlineCallbacks()
        if not _opened_later.get():
            with self._explanations:
                link.open()
        inbox = self._callbacks.inbox if isinstance(self._callbacks, ThreadCallbacks) else None
        # Also runs when the driver is garbage-collected, and at the interpreter's exit.
        self._finalizer = weakref.finalize(self, _close, inbox, link)
        self._awaited = AwaitableDevice(self._requests)
        self._parameters = DeviceParameters(self._requests)
        self._sensors = Sensors(self._requests, self._latest_sample)
        self._recorders: list[Recorder] = []

    @property
    def parameters(self) -> Parameters:
        """The device's parameters, by name: a mapping of the values known in this session."""
        return self._parameters

    @property
    def board(self) -> DeviceBoard:
        """The board that the device has stored."""
        return DeviceBoard(self._requests)

    @property
    def recorder(self) -> DeviceRecorder:
        """What the device has recorded of its stops."""
        return DeviceRecorder(self._requests)

    @property
    def sensors(self) -> Sensors:
        """All sensors of the robot."""
        return self._sensors

    def __enter__(self: DriverT) -> DriverT:
        if self._link.has_ended:
            self._check_link()  # raises why
        return self

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

        Errors that the robot raises meanwhile have the same sentence in `why`.

        Args:
            report: Called some 60 ms after a stop, up to 1.2 s after one by a sensor, in a thread
                of its own.

        Raises:
            InvalidArgument: `report` is no plain function.
            InvalidCommand: The robot is in virtual time, or is a recording.
        """
        from ..log.why.watch import StopWatch  # here, for most programs ask for none

        check_plain("watch_stops", report)
        if self._link.in_virtual_time:
            raise InvalidCommand(f"{self._link.name}: only a robot in real time can be watched")
        self._explanations.watch = watch = StopWatch(self._link, report)
        return watch

    clear_estop = blocking(AwaitableDevice.clear_estop)
    clear_fault = blocking(AwaitableDevice.clear_fault)
    device_counters = blocking(AwaitableDevice.device_counters)
    holding = blocking(AwaitableDevice.holding)
    contradictions = blocking(AwaitableDevice.contradictions)
    unsaved_parameters = blocking(AwaitableDevice.unsaved_parameters)
    control_counters = blocking(AwaitableDevice.control_counters)

    def stop(self) -> None:
        """Stop both wheels and wait for the acknowledgement.

        Raises:
            LinkLost: There is no session; the stop was sent if the port is there.
            RequestTimeout: It was not acknowledged; the setpoint's deadline acts.
        """
        with self._explanations:
            self._link.stop()

    def estop(self) -> None:
        """Stop both wheels and latch; otherwise as `stop`."""
        with self._explanations:
            self._link.estop()

    def shutdown(self) -> None:
        """Stop the robot, close the port, end the thread. Safe to call more than once."""
        # Also for those who call this in place of `close`: iterators then end.
        self._callbacks.close()
        self._latest_sample.close()
        # Not by the finalizer: one that was interrupted would do nothing the next time.
        self._link.close()
        for recorder in self._recorders:
            recorder.close()
        self._finalizer.detach()
        self._callbacks.wait()


def _close(inbox: Inbox | None, link: DeviceLink) -> None:
    if inbox is not None:
        inbox.close()
    link.close()
