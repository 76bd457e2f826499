"""How well the firmware's velocity loop drives the simulated robot, measured on the plant itself.

All in virtual time: the same figures at every run, on any machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .virtual import VirtualRobot

COMMAND_PERIOD_S = 0.02
SETTLED = 0.05
"""Within this fraction of the target."""
CRAWL_EDGE_ERROR_TICKS = 0.2
"""A cheap encoder: its edges are off by up to this."""


@dataclass(frozen=True)
class Step:
    """A step of the velocity setpoint."""

    settling_s: float
    """From the command until the speed stays within SETTLED of the target."""
    overshoot: float
    """Beyond the target, as a fraction of it."""
    slew_s: float
    """The part of `settling_s` that the acceleration limit takes."""


@dataclass(frozen=True)
class Trace:
    """The left wheel's true speed, a point each control period."""

    speeds_mps: list[float]
    period_s: float


def _trace(robot: VirtualRobot, target_mps: float, seconds: float) -> Trace:
    speeds = []
    for step in range(round(seconds * 1000)):
        if step % 20 == 0:
            robot.set_velocity(target_mps, target_mps)
        robot.step()
        speeds.append(robot.sim.get("true.left_mps"))
    return Trace(speeds, 0.001)


def velocity_step(target_mps: float = 0.3) -> Step:
    """From standstill to `target_mps`."""
    robot = VirtualRobot().open()
    acceleration = robot.parameter("max_acceleration_mps2")
    trace = _trace(robot, target_mps, 2.0)
    return Step(
        settling_s=_settling_s(trace, target_mps),
        overshoot=max(0.0, max(trace.speeds_mps) / target_mps - 1),
        slew_s=target_mps / acceleration,
    )


def crawl_ripple(target_mps: float = 0.03, edge_error_ticks: float = 0.0) -> float:
    """Peak deviation of the speed from its mean once steady, as a fraction of the target."""
    robot = VirtualRobot().open()
    robot.sim.set("left.encoder_error_ticks", edge_error_ticks)
    _trace(robot, target_mps, 3.0)
    speeds = _trace(robot, target_mps, 6.0).speeds_mps
    mean = sum(speeds) / len(speeds)
    return max(abs(speed - mean) for speed in speeds) / target_mps


def load_step(target_mps: float = 0.2, load_nm: float = 0.02) -> tuple[float, float]:
    """(dip, recovery): a load comes on at speed.

    Returns:
        The greatest loss of speed as a fraction of the target, and the time from the load until
        the speed stays within SETTLED of the target. [s]
    """
    robot = VirtualRobot().open()
    _trace(robot, target_mps, 2.0)
    robot.sim.set("left.load_nm", load_nm)
    trace = _trace(robot, target_mps, 3.0)
    return 1 - min(trace.speeds_mps) / target_mps, _settling_s(trace, target_mps)


def straightness(motor_scale: float = 0.85, target_mps: float = 0.3, seconds: float = 5.0) -> float:
    """Heading error after driving straight from standstill with a weaker left motor. [rad]"""
    robot = VirtualRobot(1, **{"left.motor_scale": motor_scale}).open()
    _trace(robot, target_mps, seconds)
    return abs(robot.sim.get("true.heading_rad"))


def _settling_s(trace: Trace, target_mps: float) -> float:
    """When the trace enters the band around the target for good; NaN if it never does."""
    for index in range(len(trace.speeds_mps), 0, -1):
        if abs(trace.speeds_mps[index - 1] / target_mps - 1) > SETTLED:
            return math.nan if index == len(trace.speeds_mps) else index * trace.period_s
    return 0.0
