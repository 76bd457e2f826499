"""The figure eight: the twist at each time, and the path that results.

At constant speed and with the heading B (1 - cos phi), phi from 0 to 2 pi, the path closes if the
integrals of cos and sin of the heading over phi vanish. Both are multiples of the Bessel
function J0(B), so B is its first zero. The turn rate is smooth and the path crosses itself once.
"""

from __future__ import annotations

import math

from wheelwire.motion.kinematics import Twist
from wheelwire.motion.odometry import Pose

SPEED_MPS = 0.25
LAP_S = 20.0
RAMP_S = 1.0
"""Time of the speed's rise from 0, so that a real robot can follow the path from its start."""
SWING_RAD = 2.404825557695773
"""The first zero of J0."""

DURATION_S = LAP_S + RAMP_S / 2


def twist_at(seconds: float) -> Twist:
    """The twist to command `seconds` after the start; straight ahead after DURATION_S."""
    if seconds >= DURATION_S:
        return Twist(SPEED_MPS, 0.0)
    # The phase follows the distance, not the time: otherwise the ramp would bend the figure.
    rate = min(1.0, seconds / RAMP_S)
    travelled_s = seconds * rate / 2 if seconds < RAMP_S else seconds - RAMP_S / 2
    phase = 2 * math.pi * travelled_s / LAP_S
    turn_radps = 2 * math.pi / LAP_S * SWING_RAD * math.sin(phase)
    return Twist(SPEED_MPS * rate, turn_radps * rate)


def commanded_path(seconds: float, step_s: float = 0.01) -> list[Pose]:
    """The poses of a robot that follows the commands exactly, `step_s` apart."""
    poses = [Pose()]
    for step in range(round(seconds / step_s)):
        # Use the twist in the middle of a step for all of it.
        linear_mps, angular_radps = twist_at((step + 0.5) * step_s)
        poses.append(poses[-1].advance(linear_mps * step_s, angular_radps * step_s))
    return poses
