"""What the drivers of local pins share: all but the pins."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Mapping
from pathlib import Path

from ..clock import host_clock_us
from ..drivers.base import BaseDriver
from ..kinematics import DifferentialDrive, WheelVelocities
from ..parameters import Parameters
from .control_thread import ControlThread
from .drive import ControlMode, Target
from .link import Clock, LocalLink, OpenHardware
from .parameters import LocalParameters, default_values
from .statistics import LocalStatistics

log = logging.getLogger("wheelwire")


class LocalDriver(BaseDriver):
    """A robot whose control loop is a thread of this program.

    Args:
        name: Of the thread.
        open_hardware: Opens the pins; called again after they were lost.
        parameters: Values that differ from the defaults, by name.
        store: A JSON file that keeps parameters which are saved at run time.
        clock: Of the control loop.
        threaded: False when the owner calls the link's `step` itself.

    Raises:
        DriverUnavailable: A library is missing, or the hardware.
        LinkLost: The pins are out of reach.
        UnknownParameter: In `parameters`.
        ParameterOutOfRange: In `parameters`.
    """

    def __init__(
        self,
        name: str,
        open_hardware: OpenHardware,
        parameters: Mapping[str, float] | None = None,
        store: Path | None = None,
        *,
        clock: Clock = host_clock_us,
        threaded: bool = True,
    ) -> None:
        super().__init__()
        self._clock = clock
        values = default_values(parameters)
        self._link = LocalLink(open_hardware, values, self._inbox, clock)
        try:
            self._parameters = LocalParameters(
                values, self._link.configure, self._link.check_stopped, store
            )
        except BaseException:
            self._link.close()
            raise
        closer = ControlThread(self._link, name) if threaded else self._link
        # Also runs when the driver is forgotten, and at the interpreter's exit.
        self._finalizer = weakref.finalize(self, closer.close)
        for limit in self.limits:
            log.warning("%s: %s", name, limit)

    @property
    def limits(self) -> tuple[str, ...]:
        """What this wiring cannot do, in sentences; logged once as warnings."""
        return self._link.limits

    @property
    def geometry(self) -> DifferentialDrive:
        """The robot's numbers, as they are now."""
        names = ("wheel_separation", "wheel_radius", "counts_per_revolution", "max_velocity_mps")
        return DifferentialDrive(*(self._parameters.get(name) for name in names))

    @property
    def parameters(self) -> Parameters:
        """The parameters, by name: the firmware's, with its bounds."""
        return self._parameters

    @property
    def statistics(self) -> LocalStatistics:
        """What the encoders and the control loop lost."""
        return self._link.statistics

    def stop(self) -> None:
        """Remove the drive from both wheels; it is done when this returns."""
        self._link.stop()

    def estop(self) -> None:
        """Stop, and refuse to move until `clear_estop`."""
        self._link.estop()

    def clear_estop(self) -> None:
        """End the emergency stop; `DeviceRefused` while the contact is open."""
        self._link.clear_estop()

    def clear_fault(self) -> None:
        """Clear the latched faults; one whose cause lasts trips again."""
        self._link.clear_fault()

    def shutdown(self) -> None:
        """Stop the robot, end the thread, give back the pins. Harmless when repeated."""
        self._finalizer()

    def _now_us(self) -> int:
        return self._clock()

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        self._link.drive(ControlMode.VELOCITY, Target(*wheels), expiry_us)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        self._link.drive(ControlMode.DUTY, Target(left, right), expiry_us)

    def _check_link(self) -> None:
        self._link.check()
