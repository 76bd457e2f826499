"""Limits of the body's velocity, acceleration and jerk, as diff_drive_controller has them.

Pure: the time is an argument. Limits act from one command to the next: nothing here repeats a
command. A command of zero is a stop, which has no limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wheelwire import Twist

FIRST_STEP_S = 0.05
"""Assumed period of the command that starts a motion."""
MIN_STEP_S, MAX_STEP_S = 1e-6, 0.1
"""Bounds of the time since the last command: a robot that waits for one does not accelerate."""
_NAN = math.nan


@dataclass(frozen=True)
class AxisLimits:
    """Limits of one component, with diff_drive_controller's signs; NaN: none.

    If a bound of the other direction is NaN, the limits are symmetrical.

    Attributes:
        max_velocity: At least 0. [m/s or rad/s]
        min_velocity: At most 0; NaN: -max_velocity.
        max_acceleration: Away from zero, positive velocities; at least 0. [m/s^2 or rad/s^2]
        max_deceleration: Towards zero, positive velocities; at most 0; NaN: -max_acceleration.
        max_acceleration_reverse: Away from zero, negative velocities; at most 0; NaN:
            -max_acceleration.
        max_deceleration_reverse: Towards zero, negative velocities; at least 0; NaN:
            -max_deceleration.
        max_jerk: Growth of the acceleration upwards; at least 0. [m/s^3 or rad/s^3]
        min_jerk: Growth of the acceleration downwards; at most 0; NaN: -max_jerk.
    """

    max_velocity: float = _NAN
    min_velocity: float = _NAN
    max_acceleration: float = _NAN
    max_deceleration: float = _NAN
    max_acceleration_reverse: float = _NAN
    max_deceleration_reverse: float = _NAN
    max_jerk: float = _NAN
    min_jerk: float = _NAN

    def excess(self, velocity: float) -> float:
        """The factor by which a velocity exceeds its limit; at least 1, and 1 for a limit of 0."""
        bound = self._velocity_bound(velocity)
        return max(1.0, abs(velocity) / bound) if bound > 0 else 1.0

    def clamp(self, velocity: float) -> float:
        """The nearest velocity within the limits."""
        return math.copysign(min(abs(velocity), self._velocity_bound(velocity)), velocity)

    def ramp(self, target: float, last: Motion, dt_s: float) -> float:
        """The velocity after a step towards `target`, within acceleration and jerk.

        The jerk limits how an acceleration builds up. It may end at once, so the velocity never
        passes its target.
        """
        # 0 is always allowed: that is the acceleration that ends at once.
        least = min(0.0, last.acceleration - _bound(self.min_jerk, self.max_jerk) * dt_s)
        most = max(0.0, last.acceleration + _bound(self.max_jerk) * dt_s)
        low, high = last.velocity + least * dt_s, last.velocity + most * dt_s
        return self._accelerate(last.velocity, min(max(target, low), high), dt_s)

    def _accelerate(self, start: float, target: float, dt_s: float) -> float:
        """Slow down to zero if the direction changes, then speed up for the rest of the step."""
        if abs(target) < abs(start) or start * target < 0:
            slowing = self._deceleration(start) * dt_s
            goal = target if start * target > 0 else 0.0
            if abs(start - goal) >= slowing:
                return start - math.copysign(slowing, start)
            if goal == target:
                return target
            # The robot stands before the step is over, and uses the rest for the other direction.
            dt_s *= 1 - abs(start) / slowing
            start = 0.0
        gain = self._acceleration(target) * dt_s
        if abs(target - start) <= gain:
            return target
        return start + math.copysign(gain, target - start)

    def _velocity_bound(self, velocity: float) -> float:
        reverse = (self.min_velocity,) if velocity < 0 else ()
        return _bound(*reverse, self.max_velocity)

    def _acceleration(self, velocity: float) -> float:
        reverse = (self.max_acceleration_reverse,) if velocity < 0 else ()
        return _bound(*reverse, self.max_acceleration)

    def _deceleration(self, velocity: float) -> float:
        reverse = (self.max_deceleration_reverse,) if velocity < 0 else ()
        return _bound(*reverse, self.max_deceleration, self.max_acceleration)


class Limits(NamedTuple):
    """Limits of both components."""

    linear: AxisLimits = AxisLimits()
    """Along x."""
    angular: AxisLimits = AxisLimits()
    """About z."""


NO_LIMITS = Limits()


class Motion(NamedTuple):
    """The last command of one component."""

    velocity: float = 0.0
    acceleration: float = 0.0


class _Last(NamedTuple):
    """The last command that was obeyed; the default: the robot stands."""

    linear: Motion = Motion()
    angular: Motion = Motion()
    at_s: float = -math.inf
    until_s: float = -math.inf

    def step_s(self, now_s: float) -> float:
        """How much time a command at `now_s` may use for a change."""
        if self.at_s == -math.inf:
            return FIRST_STEP_S
        # Above 0, since an unlimited jerk is infinity, and infinity times 0 is NaN.
        return min(max(now_s - self.at_s, MIN_STEP_S), MAX_STEP_S)


class SpeedLimiter:
    """Limits a robot's commands, one after the other; `rest` may be called in any thread."""

    def __init__(self) -> None:
        self._last = _Last()

    def limit(self, twist: Twist, limits: Limits, now_s: float) -> Twist:
        """The velocity to command now; a value that is not finite stays so.

        Args:
            twist: The requested velocity.
            limits: The present limits.
            now_s: On a monotonic clock.
        """
        if twist == (0.0, 0.0) or not all(map(math.isfinite, twist)):
            return twist
        last = self._last_at(now_s)
        dt_s = last.step_s(now_s)
        linear, angular = limits
        # Both by one factor, so that the path keeps its curvature.
        excess = max(linear.excess(twist.linear_mps), angular.excess(twist.angular_radps))
        # Clamped after the ramp, which starts from the last command: that may be above a limit that
        # was lowered since.
        return Twist(
            linear.clamp(linear.ramp(twist.linear_mps / excess, last.linear, dt_s)),
            angular.clamp(angular.ramp(twist.angular_radps / excess, last.angular, dt_s)),
        )

    def obeyed(self, twist: Twist, now_s: float, ttl_s: float) -> None:
        """Record a velocity that was sent to the robot; the next command starts from it."""
        last = self._last_at(now_s)
        dt_s = last.step_s(now_s)
        self._last = _Last(
            _step(last.linear, twist.linear_mps, dt_s),
            _step(last.angular, twist.angular_radps, dt_s),
            now_s,
            now_s + ttl_s,
        )

    def rest(self) -> None:
        """Start from zero: the robot stopped."""
        self._last = _Last()

    def _last_at(self, now_s: float) -> _Last:
        last = self._last
        # A command that has expired ended with a stop, so the next one starts from zero.
        return last if now_s < last.until_s else _Last()


def _step(last: Motion, velocity: float, dt_s: float) -> Motion:
    if velocity == 0:
        return Motion()
    return Motion(velocity, (velocity - last.velocity) / dt_s)


def _bound(*candidates: float) -> float:
    """The magnitude of the first bound that is given; infinity if none is."""
    return next((abs(value) for value in candidates if not math.isnan(value)), math.inf)
