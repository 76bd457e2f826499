"""What a sound robot reaches in setup's test drive, depending on the length of its ticks.

The fewer ticks a wheel has, the later a change of its speed shows, and the worse it can follow. The
curve is fitted to the simulator's robots, of each plant, raised and on the floor, with 20 to 1440
ticks per turn: `bench/sound_robots.py` prints both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...robot.robot import Robot
from ..tune.before_after import TOP_MPS, Proof
from .problems import LATE_SETPOINTS, TRACKS_BADLY, Problem

FLOOR_MPS = 0.008
"""Tracking error that friction leaves, however short the ticks are."""
COARSE_MPS = 0.0149
"""Tracking error that ticks of a millimetre add, at `TOP_MPS`."""
OF_TICK = 0.63
OF_SPEED = 0.3
"""Exponents: how that error grows with the length of a tick, and with the speed of the drive."""
BEYOND = 1.3
"""Limit, as a multiple of a sound robot's result; the worst sound robot reached 1.1 times."""
LATE = 0.3
"""Setpoints that differ from the course by this multiple may be why a sound robot is beyond it."""


def sound_rms_mps(tick_m: float, top_mps: float) -> float:
    """The tracking error of a sound robot.

    Args:
        tick_m: Way of a wheel in a tick.
        top_mps: Greatest speed of the test drive.
    """
    coarse = COARSE_MPS * (tick_m * 1e3) ** OF_TICK * (top_mps / TOP_MPS) ** OF_SPEED
    return math.hypot(FLOOR_MPS, coarse)


def expected_rms_mps(robot: Robot, proof: Proof) -> float:
    """As `sound_rms_mps`, of this robot's ticks and drive."""
    values = robot.parameters
    tick_m = 2 * math.pi * values["wheel_radius"] / values["counts_per_revolution"]
    return sound_rms_mps(tick_m, proof.course.top_mps)


def judge(proof: Proof, expected_mps: float, counts: int) -> Sequence[Problem]:
    """The wheels that track worse than those of a sound robot; or why the drives do not tell.

    Args:
        proof: Both drives; the better one of a wheel is what it reaches.
        expected_mps: What a sound robot reaches.
        counts: Ticks per turn, for the message.
    """
    found = []
    for wheel in (0, 1):
        reached = [rms for rms in proof.rms_mps(wheel) if rms is not None]
        if reached and min(reached) > BEYOND * expected_mps:
            detail = (
                f"{min(reached) * 1e3:.0f} mm/s, where a sound robot of {counts} ticks per turn "
                f"reaches {expected_mps * 1e3:.0f}"
            )
            found.append(Problem(TRACKS_BADLY, wheel, detail))
    late = [
        trace.longest_gap_s
        for trace in proof.traces
        if trace and trace.late_mps(proof.course) > LATE * expected_mps
    ]
    if found and late:
        return [Problem(LATE_SETPOINTS, detail=f"{max(late) * 1e3:.0f}")]
    return found
