"""Quality of the firmware's velocity loop on the simulated robot, measured on the plant itself.

All in virtual time: the figures are the same in every run, on any machine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from wheelwire.tools.demo.figure import DURATION_S, commanded_path, twist_at

from .virtual import VirtualRobot

COMMAND_PERIOD_S = 0.02
PERIOD_S = 0.001
SETTLED = 0.05
"""Fraction of the target within which a speed counts as settled."""
CRAWL_EDGE_ERROR_TICKS = 0.2
"""Error of a cheap encoder's edges, at most."""


class Step(NamedTuple):
    """A step of the velocity setpoint."""

    settling_s: float
    """Time from the command until the speed stays within SETTLED of the target."""
    overshoot: float
    """Overshoot as a fraction of the target."""
    slew_s: float
    """The part of `settling_s` that the acceleration limit takes."""


def _trace(
    robot: VirtualRobot, target_mps: float, seconds: float, wheel: str = "left", still: str = ""
) -> list[float]:
    """A wheel's true speeds, one for each control period; the wheel `still` is to stand."""
    speeds = []
    left, right = (0.0 if side == still else target_mps for side in ("left", "right"))
    for step in range(round(seconds / PERIOD_S)):
        if step % 20 == 0:
            robot.set_velocity(left, right)
        robot.step()
        speeds.append(robot.sim.get(f"true.{wheel}_mps"))
    return speeds


def velocity_step(target_mps: float = 0.3) -> Step:
    """From standstill to `target_mps`."""
    robot = VirtualRobot().open()
    acceleration = robot.parameter("max_acceleration_mps2")
    trace = _trace(robot, target_mps, 2.0)
    return Step(
        settling_s=_settling_s(trace, target_mps),
        overshoot=max(0.0, max(trace) / target_mps - 1),
        slew_s=target_mps / acceleration,
    )


def crawl_ripple(target_mps: float = 0.03, edge_error_ticks: float = 0.0) -> float:
    """Peak deviation of the speed from its mean once steady, as a fraction of the target."""
    robot = VirtualRobot().open()
    robot.sim.set("left.encoder_error_ticks", edge_error_ticks)
    _trace(robot, target_mps, 3.0)
    speeds = _trace(robot, target_mps, 6.0)
    mean = sum(speeds) / len(speeds)
    return max(abs(speed - mean) for speed in speeds) / target_mps


def catching_up(robot: VirtualRobot, target_mps: float, load_nm: float = 0.02) -> float:
    """The left wheel's greatest speed after a load of half a second, once it is steady. [m/s]"""
    _trace(robot, target_mps, 1.0)
    robot.sim.set("left.load_nm", load_nm)
    _trace(robot, target_mps, 0.5)
    robot.sim.set("left.load_nm", 0)
    _trace(robot, target_mps, 0.5)
    return max(_trace(robot, target_mps, 1.0))


def missing_after_a_load(robot: VirtualRobot, target_mps: float, load_nm: float = 0.02) -> float:
    """How much less the left wheel rolled in total, after a load of half a second. [m]"""
    owed_m = -(target_mps**2) / 2 / robot.parameter("max_acceleration_mps2")
    for load, seconds in ((0.0, 1.0), (load_nm, 0.5), (0.0, 2.0)):
        robot.sim.set("left.load_nm", load)
        owed_m += sum(target_mps - v for v in _trace(robot, target_mps, seconds)) * PERIOD_S
    return owed_m


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
    return 1 - min(trace) / target_mps, _settling_s(trace, target_mps)


def straightness(motor_scale: float = 0.85, target_mps: float = 0.3, seconds: float = 5.0) -> float:
    """Heading error after driving straight from standstill with a weaker left motor. [rad]"""
    robot = VirtualRobot(1, **{"left.motor_scale": motor_scale}).open()
    _trace(robot, target_mps, seconds)
    return abs(robot.sim.get("true.heading_rad"))


def _settling_s(trace: list[float], target_mps: float) -> float:
    """When the trace enters the band around the target for good; NaN if it never does."""
    for index in range(len(trace), 0, -1):
        if abs(trace[index - 1] / target_mps - 1) > SETTLED:
            return math.nan if index == len(trace) else index * PERIOD_S
    return 0.0


# --- the path ------------------------------------------------------------------------------------

LAWS: dict[str, dict[str, float]] = {
    "PI alone": {
        "path_gain": 0,
        "heading_gain": 0,
        "velocity_feedforward": 0,
        "acceleration_feedforward": 0,
        "static_feedforward": 0,
        "plausibility_margin": 1,
    },
    "feed-forward and PI": {"path_gain": 0, "heading_gain": 0},
    "following the path": {},
}
"""Parameters of the loop's stages; the last one has the defaults."""


class PathPoint(NamedTuple):
    """One moment of a drive along a path."""

    seconds: float
    distance_m: float
    """Distance between the robot and its commanded position."""
    heading_rad: float
    """Heading error, positive to the left."""


def figure_eight(
    parameters: dict[str, float] | None = None, /, **settings: float
) -> list[PathPoint]:
    """Drive the demonstration's figure with 50 setpoints a second.

    Args:
        parameters: Parameters of the firmware that differ from the defaults.
        settings: The simulator's variables while it drives.

    Returns:
        The path error on the plant, one point per setpoint, the last at the figure's end.
    """
    robot = VirtualRobot().open()
    for name, value in (parameters or {}).items():
        robot.set_parameter(name, value)
    for name, value in settings.items():
        robot.sim.set(name, value)
    half_m = robot.sim.get("wheel_separation_m") / 2
    commanded = commanded_path(DURATION_S, 0.001)
    points = []
    for step in range(round(DURATION_S / COMMAND_PERIOD_S)):
        linear, angular = twist_at(step * COMMAND_PERIOD_S)
        robot.set_velocity(linear - angular * half_m, linear + angular * half_m)
        robot.run(COMMAND_PERIOD_S)
        seconds = (step + 1) * COMMAND_PERIOD_S
        goal = commanded[round(seconds * 1000)]
        true = [robot.sim.get(f"true.{name}") for name in ("x_m", "y_m", "heading_rad")]
        distance = math.hypot(true[0] - goal.x_m, true[1] - goal.y_m)
        points.append(PathPoint(seconds, distance, true[2] - goal.heading_rad))
    assert not robot.sim.get("faults")
    return points


def acceleration(target_mps: float = 0.4, over_s: float = 0.02) -> float:
    """The greatest true acceleration from standstill over a setpoint's time, in its limit."""
    robot = VirtualRobot().open()
    return _greatest(robot, _trace(robot, target_mps, 1.0), over_s)


def _greatest(robot: VirtualRobot, speeds: list[float], over_s: float) -> float:
    span = round(over_s / PERIOD_S)
    greatest = max(b - a for a, b in zip(speeds, speeds[span:], strict=False)) / over_s
    return greatest / robot.parameter("max_acceleration_mps2")


def acceleration_after_waiting(robot: VirtualRobot, held: str, waits: str) -> float:
    """The greatest one after a wheel no longer has to wait for the other, relative to its limit.

    One wheel is held fast at 0.2 m/s while the other waits for it. Then the host turns on the spot
    of the wheel that is held, which ends the waiting.
    """
    _trace(robot, 0.2, 1.0)
    robot.sim.set(f"{held}.blocked", 1)
    _trace(robot, 0.2, 0.3)
    speeds = _trace(robot, 0.2, 0.6, waits, still=held)
    assert not robot.sim.get("faults")
    return _greatest(robot, speeds, 0.02)


class Obstacle(NamedTuple):
    """The result of holding a robot's wheels and letting them go."""

    overshoot: float
    """Overshoot of the wheel that was held, as a fraction of the target."""
    heading_rad: float
    """Distance that is not caught up."""


def obstacle(target_mps: float, wheels: tuple[str, ...], after_s: float = 1.5) -> Obstacle:
    """Hold the wheels for 0.3 s at speed."""
    robot = VirtualRobot().open()
    _trace(robot, target_mps, after_s)
    before_rad = robot.sim.get("true.heading_rad")
    for blocked, seconds in ((1, 0.3), (0, 2.0)):
        for wheel in wheels:
            robot.sim.set(f"{wheel}.blocked", blocked)
        speeds = _trace(robot, target_mps, seconds, wheels[0])
    assert not robot.sim.get("faults")
    return Obstacle(
        max(speeds) / target_mps - 1, abs(robot.sim.get("true.heading_rad") - before_rad)
    )
