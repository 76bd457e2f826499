"""The driver of a robot whose ESP32 is at the other end of a serial link."""

from __future__ import annotations

import weakref
from typing import cast

from wheelwire_protocol.parameters import PARAMETER_BY_ID, PARAMETER_BY_NAME, Parameter
from wheelwire_protocol.types import (
    ClearEstop,
    ClearFault,
    LinkCounters,
    LinkCountersGet,
    ParameterEntry,
    ParameterGet,
    ParameterList,
    ParameterReset,
    ParameterSave,
    ParameterSet,
    ParameterValue,
)

from ..kinematics import DifferentialDrive, WheelVelocities
from ..link import Link, LinkInfo
from ..parameters import ParameterInfo, Parameters, decimal_of_float32
from ..statistics import LinkStatistics
from .base import BaseDriver

DEFAULT_BAUD_RATE = 921_600
GEOMETRY = tuple(
    PARAMETER_BY_NAME[name].id
    for name in ("wheel_separation", "wheel_radius", "counts_per_revolution", "max_velocity_mps")
)
"""Read from the device at each session, so that a robot's numbers live in one place."""


class DeviceParameters(Parameters):
    """The parameters that live on the device."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._known_bounds: dict[int, tuple[float, float]] = {}

    def list(self) -> tuple[ParameterInfo, ...]:
        """All parameters of the device, in its order."""
        entries = [self._entry(0)]
        entries += [self._entry(index) for index in range(1, entries[0].parameter_count)]
        self._known_bounds = {e.parameter: (e.minimum, e.maximum) for e in entries}
        return tuple(_info(entry) for entry in entries)

    def save(self) -> None:
        """Write the values to the device's flash."""
        self._link.request(ParameterSave(0, 0))

    def reset(self) -> None:
        """Restore the defaults and empty the device's store."""
        self._link.request(ParameterReset(0, 0))
        for parameter in GEOMETRY:
            self._get(parameter)  # the link keeps the answers

    def _read(self, definition: Parameter) -> float:
        return self._get(definition.id)

    def _write(self, definition: Parameter, value: float) -> float:
        message = ParameterSet(0, 0, definition.id, value)
        answer = cast("ParameterValue", self._link.request(message))
        return decimal_of_float32(answer.value)

    def _bounds(self, definition: Parameter) -> tuple[float, float]:
        if not self._known_bounds:
            self.list()
        low, high = self._known_bounds[definition.id]
        return decimal_of_float32(low), decimal_of_float32(high)

    def _get(self, parameter: int) -> float:
        answer = cast("ParameterValue", self._link.request(ParameterGet(0, 0, parameter)))
        return decimal_of_float32(answer.value)

    def _entry(self, index: int) -> ParameterEntry:
        return cast("ParameterEntry", self._link.request(ParameterList(0, 0, index)))


class SerialDriver(BaseDriver):
    """A robot behind a serial port.

    Args:
        port: Device path, pyserial URL, `socket://host:port` or `unix:path`.
        baud_rate: Tried first; then the usual ones.
        connect_timeout: How long to look for the device. [s]
        stream_rate_hz: Rate of the samples; None leaves it as the device has it. When nobody has
            asked for 0.2 s, the next one of a fast stream may be 10 ms old.
        board_id: Only this board will do (`robot.info.device.board_id`, 12 hex digits), under
            whichever name it comes back. `port` may then be glob patterns, separated by commas;
            all free ports that they match are opened to ask who is there.
        any_board: Whether to go on with another board than the first, where the port leads to one
            after a reconnection. Without it that raises `WrongBoard`, until the first is back.

    Raises:
        PortUnavailable: The port cannot be opened, or the board is at none.
        DeviceSilent: Nothing came.
        ForeignDevice: Something came, but nothing of ours.
        ProtocolMismatch: Host and firmware are of different releases.
        DeviceRefused: The device does not take the stream rate.
        RequestTimeout: A device of ours answered, but no session could be opened in time.
    """

    def __init__(
        self,
        port: str,
        *,
        baud_rate: int = DEFAULT_BAUD_RATE,
        connect_timeout: float = 5.0,
        stream_rate_hz: int | None = None,
        board_id: str | None = None,
        any_board: bool = False,
    ) -> None:
        super().__init__()
        self._link = Link(
            port,
            self._inbox,
            baud_rate=baud_rate,
            connect_timeout_s=connect_timeout,
            stream_rate_hz=stream_rate_hz,
            watched=GEOMETRY,
            board_id=board_id,
            any_board=any_board,
        )
        # Also runs when the driver is forgotten, and at the interpreter's exit.
        self._finalizer = weakref.finalize(self, Link.close, self._link)
        self._parameters = DeviceParameters(self._link)

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        return self._link.info

    @property
    def geometry(self) -> DifferentialDrive:
        """The robot's numbers, as the device has them now."""
        return DifferentialDrive(*(decimal_of_float32(self._link.value(id_)) for id_ in GEOMETRY))

    @property
    def parameters(self) -> Parameters:
        """The device's parameters, by name."""
        return self._parameters

    @property
    def statistics(self) -> LinkStatistics:
        """How the link is doing."""
        return self._link.statistics

    @property
    def sessions(self) -> int:
        """How many there were, without the work that `statistics` is."""
        return self._link.sessions

    def device_counters(self) -> LinkCounters:
        """What the device has counted at its end of the link since its reset."""
        return cast("LinkCounters", self._link.request(LinkCountersGet(0, 0)))

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
        """Stop the robot, close the port, end the thread. Harmless when repeated."""
        self._link.close()  # not by the finalizer: interrupted, it would do nothing the next time
        self._finalizer.detach()

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        self._link.drive_velocity(wheels.left_mps, wheels.right_mps, expiry_us)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        self._link.drive_duty(left, right, expiry_us)

    def _check_link(self) -> None:
        self._link.check()


def _info(entry: ParameterEntry) -> ParameterInfo:
    definition = PARAMETER_BY_ID[entry.parameter]
    return ParameterInfo(
        name=definition.name,
        value=decimal_of_float32(entry.value),
        default=decimal_of_float32(entry.default_value),
        minimum=decimal_of_float32(entry.minimum),
        maximum=decimal_of_float32(entry.maximum),
        unit=definition.unit.value,
        kind=definition.kind,
        doc=definition.doc,
    )
