"""Robots to commission, in virtual time, and what is true of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np

from wheelwire.drivers.mock import MockDriver
from wheelwire.tools.files.plant import load_plant, shipped_plants
from wheelwire.tools.setup.expectation import expected_rms_mps
from wheelwire.tools.setup.gains import tuned
from wheelwire.tools.setup.identification import STAIRS, Identification, identify
from wheelwire.tools.tune.before_after import Proof, prove, there_and_back

PLANTS = tuple(shipped_plants())
BATTERIES_V = (6.5, 7.4, 9.0)
"""Voltages for a robot of 7.4 V: another robot's change in the same proportion."""
NOMINAL_V = 7.4
OWN = ("counts_per_revolution", "wheel_radius", "wheel_separation")
"""Parameters that a robot has before its motors are identified."""


def plant_robot(
    plant: str,
    battery_v: float = NOMINAL_V,
    *,
    raised: bool,
    settings: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> MockDriver:
    """A plant's robot that knows its own dimensions; all else is as on a new board.

    Args:
        plant: One of `PLANTS`.
        battery_v: As `BATTERIES_V`.
        raised: Whether its wheels hang free.
        settings: Variables of the simulation that differ from the plant's.
        parameters: Parameters of the firmware that differ from the defaults.
    """
    values = load_plant(plant).settings
    dimensions = {name: values.get(name, values.get(f"{name}_m", 0.0)) for name in OWN}
    robot = MockDriver(realtime=False, parameters={**dimensions, **(parameters or {})})
    supply_v = values["supply_v"] * battery_v / NOMINAL_V
    values |= {"supply_v": supply_v, "battery_v": supply_v, "wheels_free": raised}
    counts = {"counts_per_revolution": robot.parameters["counts_per_revolution"]}
    for name, value in {**values, **counts, **(settings or {})}.items():
        robot.simulator.set(name, value)
    return robot


class TrueLine(NamedTuple):
    """The least-squares line of a plant's speed over duty, without encoders."""

    velocity_feedforward: float
    static_feedforward: float


@cache
def plant_line(plant: str, battery_v: float) -> TrueLine:
    """The line that the feed-forward of a plant's robot is to have, by its raised left wheel.

    By its steady speeds, downward from where it turns, as long as it turns.
    """
    lowest, highest = STAIRS
    curve = []
    with plant_robot(plant, battery_v, raised=True) as ideal:
        for duty in np.arange(highest, lowest - 0.005, -0.01):
            for _ in range(6):
                ideal.set_duty(duty, duty, 0.5)
                ideal.advance(0.25)
            if (speed := ideal.simulator.get("true.left_mps")) > 0:
                curve.append((float(duty), speed))
    duties, speeds = zip(*curve, strict=True)
    slope, intercept = np.polyfit(duties, speeds, 1)
    return TrueLine(1 / slope, -intercept / slope)


def true_breakaway(robot: MockDriver) -> float:
    """The duty at which the left wheel starts from rest."""
    duty = 0.0
    while robot.simulator.get("true.left_mps") == 0:
        duty += 0.0005
        robot.set_duty(duty, duty, 0.1)
        robot.advance(0.01)
    robot.stop()
    robot.advance(1.0)
    return duty


def true_time_constant_s(robot: MockDriver, low: float = 0.3, high: float = 0.5) -> float:
    """Time constant of the left wheel's speed between two duties."""
    for _ in range(8):
        robot.set_duty(low, low, 0.5)
        robot.advance(0.25)
    speeds = []
    for step in range(2000):
        if step % 100 == 0:
            robot.set_duty(high, high, 0.5)
        robot.advance(0.001)
        speeds.append(robot.simulator.get("true.left_mps"))
    robot.stop()
    robot.advance(1.0)
    # The slew limit's ramp, and the setpoint's way of a millisecond or two, come before.
    ramp_s = (high - low) / robot.parameters["max_duty_rate_per_s"]
    level = speeds[0] + (1 - math.exp(-1)) * (speeds[-1] - speeds[0])
    return next(k for k, speed in enumerate(speeds) if speed >= level) * 1e-3 - ramp_s / 2


def true_rms_mps(robot: MockDriver, values: Mapping[str, float], top_mps: float = 0.3) -> float:
    """The tracking error of both wheels' true speeds on the course, with these parameters."""
    for name, value in values.items():
        robot.parameters.set(name, value)
    course = there_and_back(top_mps, 1.0)
    robot.advance(1.0)
    errors = []
    for step in range(round(course.seconds * 200)):
        if step % 2 == 0:  # active from about 1 ms later, for 10 ms
            robot.set_wheel_velocity(*course.at(step * 5e-3 + 0.006), 0.3)
        robot.advance(0.005)
        goal = course.at((step + 1) * 5e-3)
        errors += [
            robot.simulator.get("true.left_mps") - goal.left,
            robot.simulator.get("true.right_mps") - goal.right,
        ]
    robot.stop()
    robot.advance(1.0)
    return math.sqrt(sum(error**2 for error in errors) / len(errors))


class Outcome(NamedTuple):
    """One robot, commissioned."""

    truth: TrueLine
    found: Identification
    values: dict[str, float]
    proof: Proof
    true_before_mps: float
    """On the floor, also of a robot that was identified raised."""
    true_after_mps: float

    @property
    def slope_error(self) -> float:
        """Error of the velocity feed-forward, as a fraction."""
        return self.found.velocity_feedforward / self.truth.velocity_feedforward - 1

    @property
    def offset_error(self) -> float:
        """Error of the static feed-forward, as a fraction."""
        return self.found.static_feedforward / self.truth.static_feedforward - 1

    @property
    def ratio(self) -> float:
        """Tracking error after to before, as proved."""
        before, after = self.proof.rms_mps(0, 1)
        assert before is not None
        assert after is not None
        return after / before

    @property
    def true_ratio(self) -> float:
        """The same of the wheels' true speeds, on the floor."""
        return self.true_after_mps / self.true_before_mps


def commission(plant: str, battery_v: float, *, raised: bool, counts: int = 0) -> Outcome:
    """Identify, tune and prove a robot with its plant's encoders, or with `counts` a turn."""
    parameters = {"counts_per_revolution": counts} if counts else None
    truth = plant_line(plant, battery_v)
    with plant_robot(plant, battery_v, raised=raised, parameters=parameters) as robot:
        found = identify(robot, lambda _: None, on_the_floor=not raised)
        values = tuned(found, robot)
        before = {name: robot.parameters[name] for name in values}
        proof = prove(robot, before, values)
        robot.simulator.set("wheels_free", 0)
        true_mps = [true_rms_mps(robot, chosen) for chosen in (before, values)]
    return Outcome(truth, found, values, proof, *true_mps)


class Tracking(NamedTuple):
    """How well a robot follows setup's test drive with the values found for it."""

    rms_mps: tuple[float, float]
    """The better one of both drives, of each wheel."""
    expected_mps: float
    """Of a sound robot."""


def tracking(
    plant: str, counts: int, *, raised: bool, settings: Mapping[str, float] | None = None
) -> Tracking:
    """Identify and tune a plant's robot with `counts` ticks per turn, and drive."""
    own = {"counts_per_revolution": float(counts)}
    with plant_robot(plant, raised=raised, settings=settings, parameters=own) as robot:
        values = tuned(identify(robot, lambda _: None, on_the_floor=not raised), robot)
        proof = prove(robot, {name: robot.parameters[name] for name in values}, values)
        expected_mps = expected_rms_mps(robot, proof)
    left, right = (min(rms for rms in proof.rms_mps(w) if rms is not None) for w in (0, 1))
    return Tracking((left, right), expected_mps)
