"""The common part of all drivers that reach their robot by the protocol over a byte stream."""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING, TypeAlias, cast

from wheelwire_protocol.codes import Contradiction
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

from ..errors import LinkClosed, LinkLost, WheelwireError
from ..link.connection import Link
from ..link.latest_sample import LatestSample
from ..link.requests import Answer
from ..parameters import Parameters
from .base import BaseDriver
from .callbacks import Inbox, ThreadCallbacks
from .device_board import DeviceBoard
from .device_parameters import DeviceParameters
from .linked import LinkedRobot
from .options import TransportOptions, takes

if TYPE_CHECKING:
    from ..simulation.virtual_link import VirtualLink

DeviceLink: TypeAlias = "Link | VirtualLink"


_opened_later: ContextVar[bool] = ContextVar("opened_later", default=False)


@contextmanager
def opened_later() -> Iterator[None]:
    """A driver that is made in here does not open its link: whoever makes it does."""
    before = _opened_later.set(True)
    try:
        yield
    finally:
        _opened_later.reset(before)


class DeviceDriver(LinkedRobot, BaseDriver):
    """A robot whose device is reached over a link.

    Args:
        make_link: Makes the link, which puts samples into the argument. The driver opens and
            closes it.
    """

    def __init__(self, make_link: Callable[[LatestSample], DeviceLink]) -> None:
        super().__init__()
        self._link: DeviceLink = make_link(self._latest_sample)
        link = self._link
        if not _opened_later.get():
            link.open()
        inbox = self._callbacks.inbox if isinstance(self._callbacks, ThreadCallbacks) else None
        # Also runs when the driver is garbage-collected, and at the interpreter's exit.
        self._finalizer = weakref.finalize(self, _close, inbox, link)
        self._parameters = DeviceParameters(link)
        # The link's thread appends to it: a deque needs no lock.
        self._newest_counters: deque[ControlCounters] = deque(maxlen=1)

    @property
    def parameters(self) -> Parameters:
        """The device's parameters, by name: a mapping of the values known in this session."""
        return self._parameters

    @property
    def board(self) -> DeviceBoard:
        """The board that the device has stored."""
        return DeviceBoard(self._link)

    def device_counters(self) -> LinkCounters:
        """What the device has counted at its end of the link since its reset."""
        return cast("LinkCounters", self._link.request(LinkCountersGet(0, 0)))

    def contradictions(self) -> Contradiction:
        """Which active parameters contradict each other, or the board: nothing drives meanwhile."""
        answer = cast("Contradictions", self._link.request(ContradictionsGet(0, 0)))
        return Contradiction(answer.active)

    def control_counters(self) -> ControlCounters:
        """What the device's control loop and encoders have counted since its reset."""
        return cast("ControlCounters", self._link.request(ControlCountersGet(0, 0)))

    def latest_control_counters(self) -> ControlCounters | None:
        """As `control_counters`, without waiting: the newest answer to an earlier call."""
        newest = self._newest_counters
        known = newest[0] if newest else None  # first: this call's answer may come while it asks

        def keep(answer: Answer | WheelwireError) -> None:
            if isinstance(answer, ControlCounters):
                newest.append(answer)

        with suppress(LinkLost, LinkClosed):
            self._link.post(ControlCountersGet(0, 0), keep)
        return known

    def stop(self) -> None:
        """Stop both wheels and wait for the acknowledgement.

        Raises:
            LinkLost: There is no session; the stop was sent if the port is there.
            RequestTimeout: It was not acknowledged; the setpoint's deadline acts.
        """
        self._link.stop()

    def estop(self) -> None:
        """Stop both wheels and latch; otherwise as `stop`."""
        self._link.estop()

    def clear_estop(self) -> None:
        """End the emergency stop; `DeviceRefused` while its cause lasts."""
        self._link.request(ClearEstop(0, 0))

    def clear_fault(self) -> None:
        """Clear the latched faults; `DeviceRefused` while their cause lasts."""
        self._link.request(ClearFault(0, 0))

    def shutdown(self) -> None:
        """Stop the robot, close the port, end the thread. Safe to call more than once."""
        # Also for those who call this in place of `close`: iterators then end.
        self._callbacks.close()
        self._latest_sample.close()
        # Not by the finalizer: one that was interrupted would do nothing the next time.
        self._link.close()
        self._finalizer.detach()
        self._callbacks.wait()


def _close(inbox: Inbox | None, link: DeviceLink) -> None:
    if inbox is not None:
        inbox.close()
    link.close()


class TransportDriver(DeviceDriver):
    """A robot behind a transport: the base of drivers for other kinds of lines.

    Args:
        name: What the transport leads to, for messages: `l298n`, `/dev/ttyUSB0`.
        open_transport: Opens the byte stream, at a baud rate where there is one; called again
            whenever it was lost. The link's thread calls it. It may raise any WheelwireError.
            Without it `name` is a port.
        baud_rate: Tried first.
        connect_timeout: How long to look for the device, once the transport is open. [s]
        stream_rate_hz: Rate of the samples; None keeps the device's own. If nobody has read
            for 0.2 s, the next sample of a fast stream may be 10 ms old.
        board_id: Accept only this board; see `SerialDriver`.
        any_board: See `SerialDriver`; with `open_transport` any board is accepted.
        parameters: Values that the device is given whenever a session opens, by name; it saves
            none of them.

    Raises:
        WheelwireError: What `open_transport` raises.
        InvalidArgument: The timeout or the rate is of a wrong type or size.
        DeviceSilent: Nothing came.
        ForeignDevice: Bytes came, but no Wheelwire frame.
        ProtocolMismatch: Host and firmware are of different releases.
        DeviceRefused: The device refused the stream rate or a parameter.
        UnknownParameter: A name in `parameters` is unknown.
        ParameterOutOfRange: A value in `parameters` is out of range.
        RequestTimeout: A Wheelwire device answered, but no session could be opened in time.
    """

    @takes(TransportOptions)
    def __init__(self, options: TransportOptions) -> None:
        super().__init__(partial(Link, options.checked()))
