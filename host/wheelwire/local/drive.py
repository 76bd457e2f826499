"""Both wheels together: setpoints with slew limits that keep the path, and the stop."""

from __future__ import annotations

import enum
from typing import NamedTuple

from wheelwire_protocol.codes import Fault, StopMode

from .bridge import L298nStage
from .fault_monitor import WheelFault
from .hardware import Hardware, WheelPair
from .settings import ControlSettings
from .wheel import Wheel

LEFT_FAULTS = {
    WheelFault.NOT_COUNTING: Fault.LEFT_NOT_COUNTING,
    WheelFault.REVERSED: Fault.LEFT_REVERSED,
}
RIGHT_FAULTS = {
    WheelFault.NOT_COUNTING: Fault.RIGHT_NOT_COUNTING,
    WheelFault.REVERSED: Fault.RIGHT_REVERSED,
}


class ControlMode(enum.Enum):
    """What a target means."""

    VELOCITY = "m/s"
    DUTY = "duty"


class Target(NamedTuple):
    """For both wheels, in the unit of the control mode."""

    left: float
    right: float

    def scaled_to(self, limit: float) -> Target:
        """Both by one factor, so that neither exceeds `limit` and the path keeps its curvature."""
        peak = max(abs(self.left), abs(self.right))
        if peak <= limit:
            return self
        return Target(self.left * limit / peak, self.right * limit / peak)

    def approach(self, to: Target, max_step: float) -> Target:
        """One slew-limited step: both wheels arrive at the same time."""
        left, right = to.left - self.left, to.right - self.right
        peak = max(abs(left), abs(right))
        if peak <= max_step:
            return to
        return Target(self.left + left * max_step / peak, self.right + right * max_step / peak)


class Drive:
    """The two wheels on opened hardware; they coast until told otherwise."""

    def __init__(self, hardware: Hardware) -> None:
        counters = hardware.ticks()
        self.left = Wheel(L298nStage(hardware.left), counters.left)
        self.right = Wheel(L298nStage(hardware.right), counters.right)
        self._following: ControlMode | None = None
        self._slewed = Target(0.0, 0.0)
        self._brake_until_us = 0
        self.left.coast()
        self.right.coast()

    def latch(self, counters: WheelPair, now_us: int, settings: ControlSettings) -> Fault:
        """Take both encoders' readings; returns the faults that they show."""
        faults = Fault(0)
        left = self.left.latch(counters.left, now_us, settings.left, settings)
        right = self.right.latch(counters.right, now_us, settings.right, settings)
        if left:
            faults |= LEFT_FAULTS[left]
        if right:
            faults |= RIGHT_FAULTS[right]
        return faults

    def follow(self, mode: ControlMode, target: Target, settings: ControlSettings) -> None:
        """One control step towards the target."""
        left, right = self.left, self.right
        if self._following is not mode:
            # From the speed that the wheels have, not from the one they once had.
            self._following = mode
            self._slewed = (
                Target(left.velocity_mps, right.velocity_mps)
                if mode is ControlMode.VELOCITY
                else Target(left.duty, right.duty)
            )
        if mode is ControlMode.VELOCITY:
            self._slewed = self._slewed.approach(target, settings.velocity_step_mps)
            left.drive_velocity(self._slewed.left, settings.left, settings.gains)
            right.drive_velocity(self._slewed.right, settings.right, settings.gains)
        else:
            self._slewed = self._slewed.approach(target, settings.duty_step)
            left.drive_duty(self._slewed.left, settings.left)
            right.drive_duty(self._slewed.right, settings.right)

    def begin_stop(self, now_us: int, settings: ControlSettings) -> None:
        """Remove the drive at once, past the slew limits, and begin the stop."""
        brakes = settings.stop_mode is StopMode.BRAKE
        self._brake_until_us = now_us + settings.brake_time_us if brakes else now_us
        self._following = None
        self.keep_stopped(now_us)

    def keep_stopped(self, now_us: int) -> None:
        """One control step of a stop: brakes for its time, then coasts."""
        if now_us < self._brake_until_us:
            self.left.brake()
            self.right.brake()
        else:
            self.left.coast()
            self.right.coast()
