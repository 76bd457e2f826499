"""A driver of another package that has no link to a Wheelwire device."""

from __future__ import annotations

import wheelwire
from wheelwire.motion.kinematics import DifferentialDrive, WheelVelocities
from wheelwire.parameters import Parameters


class LinklessRobot(wheelwire.BaseDriver):
    """Only notes what it is asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[WheelVelocities] = []

    def stop(self) -> None:
        self.sent.clear()

    estop = clear_estop = clear_fault = shutdown = stop

    @property
    def geometry(self) -> DifferentialDrive:
        return DifferentialDrive(0.2, 0.05, 1000, max_velocity_mps=0.5)

    @property
    def ttl_max_s(self) -> float:
        return 0.8

    @property
    def statistics(self) -> wheelwire.LinkStatistics:
        return wheelwire.LinkStatistics(sessions=3)

    @property
    def parameters(self) -> Parameters:
        raise NotImplementedError

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        assert expiry_us > 0
        self.sent.append(wheels)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        raise NotImplementedError

    def _check_link(self) -> None:
        return
