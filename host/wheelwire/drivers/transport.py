"""A robot behind a transport: the base of drivers for other kinds of lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

from ..link.connection import Link, LinkOptions
from ..link.port_loop import OpenPort
from ..robot.robot import Robot
from .options import DeviceOptions, takes


@dataclass(frozen=True)
class TransportOptions(DeviceOptions):
    """The options of `TransportDriver`."""

    name: str
    open_transport: OpenPort | None = None
    parameters: Mapping[str, float] | None = field(default=None, kw_only=True)

    def checked(self) -> LinkOptions:
        """The link, with these options, checked."""
        return self.link_to(self.name, self.open_transport, parameters=self.parameters)


class TransportDriver(Robot):
    """A robot behind a transport: the base of drivers for other kinds of lines.

    Args:
        name: What the transport leads to, for messages: `l298n`, `/dev/ttyUSB0`.
        open_transport: Opens the byte stream, at a baud rate if it has one. The link's thread calls
            it, again after each loss. It may raise any WheelwireError. Without it, `name` is a
            port.
        baud_rate: Tried first.
        connect_timeout: How long to look for the device, once the transport is open. [s]
        stream_rate_hz: Rate of the samples; None keeps the device's own. If no sample was read for
            0.2 s, the next sample of a fast stream may be 10 ms old.
        board_id: Accept only this board; see `SerialDriver`.
        any_board: See `SerialDriver`; with `open_transport` any board is accepted.
        tap: See `SerialDriver`.
        parameters: Values, by name, that the device gets whenever a session opens. It does not save
            them.

    Raises:
        WheelwireError: What `open_transport` raises.
        InvalidArgument: The timeout or the rate is of a wrong type or size.
        DeviceSilent: No bytes came.
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
