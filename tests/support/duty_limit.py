"""Wheels that do not do what they are driven to, at every duty limit, and sound robots at theirs.

In virtual time. The active limit of a wheel is `max_duty`, or what is plausible at its setpoint and
supply, whichever is lower.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from random import Random
from typing import NamedTuple

from wheelwire_protocol.codes import Fault
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from .plausibility import Outcome, Sound, Trip, trips, until_fault
from .virtual import VirtualRobot

FAILURES = ("encoder_dead", "encoder_reversed", "motor_reversed", "blocked")
SUPPLIES_V = (5.5, 6.4, 7.4, 9.0, 11.1, 12.6)
MAX_DUTIES = (0.15, 0.2, 0.3, 0.4, 0.6, 1.0)
SETPOINTS = (
    (0.02, 0.02),
    (0.05, 0.05),
    (0.1, 0.1),
    (0.2, 0.2),
    (0.4, 0.4),
    (-0.02, -0.02),
    (-0.1, -0.1),
    (-0.3, -0.3),
    (0.02, -0.02),
    (0.1, -0.1),
    (-0.3, 0.3),
    (0.05, 0.2),
    (0.3, 0.1),
)
"""In m/s, of the wheel that fails and of the other one."""

AFTER_LIMIT_S = 1.2
"""From the limit to the fault, at most."""
WATCHED_S = 4.0


def default(name: str) -> float:
    """A parameter's default."""
    return PARAMETER_BY_NAME[name].default


def supply_ratio(battery_v: float) -> float:
    """Nominal over present supply, both behind the bridge; 0 V is a battery not measured."""
    volts = battery_v or default("unmeasured_supply_v")
    drop_v = default("supply_drop_v")
    return (default("nominal_supply_v") - drop_v) / (volts - drop_v)


def active_limit(setpoint_mps: float, max_duty: float, battery_v: float) -> float:
    """The duty that a wheel never exceeds at a constant setpoint."""
    margin = 1.25 * default("plausibility_margin")
    feed_forward = default("velocity_feedforward") * abs(setpoint_mps)
    plausible = feed_forward + default("static_feedforward") + margin
    return min(max_duty, plausible * supply_ratio(battery_v))


# --- wheels that fail ----------------------------------------------------------------------------


class Failure(NamedTuple):
    """One wheel that fails before the first setpoint."""

    what: str
    side: str
    supply_v: float
    measured: bool
    max_duty: float
    setpoint: tuple[float, float]

    @property
    def battery_v(self) -> float:
        """As the firmware measures it."""
        return self.supply_v if self.measured else 0.0

    @property
    def allowed_s(self) -> float:
        """From the first setpoint to the fault, at most."""
        return 2.6 if abs(self.setpoint[0]) < 0.1 else 1.5


def matrix() -> Iterator[Failure]:
    """Every failure at every supply, limit and setpoint; the sides alternately."""
    sides = itertools.cycle(("left", "right"))
    for what, supply_v, measured, max_duty, setpoint in itertools.product(
        FAILURES, SUPPLIES_V, (True, False), MAX_DUTIES, SETPOINTS
    ):
        yield Failure(what, next(sides), supply_v, measured, max_duty, setpoint)


def detect(failure: Failure) -> Outcome:
    """Drive a robot with this failure until a fault trips, or for `WATCHED_S`."""
    robot = VirtualRobot(1, supply_v=failure.supply_v, battery_v=failure.battery_v).open()
    robot.set_parameter("max_duty", failure.max_duty)
    robot.sim.set(f"{failure.side}.{failure.what}", 1)
    near = 0.97 * active_limit(failure.setpoint[0], failure.max_duty, failure.battery_v)
    return until_fault(robot, failure.side, failure.setpoint, WATCHED_S, near)


def is_in_time(failure: Failure, found: Outcome) -> bool:
    """Whether the wheel that failed tripped a fault, and no other, soon enough."""
    side = failure.side.upper()
    expected = Fault[f"{side}_NOT_COUNTING"] | Fault[f"{side}_REVERSED"]
    return (
        bool(found.faults)
        and not found.faults & ~expected
        and found.seconds <= failure.allowed_s
        and found.at_limit_s <= AFTER_LIMIT_S
    )


# --- sound robots --------------------------------------------------------------------------------

SPARE = 1.15
"""Torque at the limit over what starts the loaded wheel: at 1 the motor cannot turn it."""
GRAVITY = 9.81
RADIUS_M = 0.033
STATIC_NM = 0.009


def healthy(seconds: float, seed: int) -> list[Trip]:
    """Drive sound robots so long, mostly faster than their limits allow."""
    return trips(seconds, seed, sound_robot)


def sound_robot(random: Random) -> Sound:
    """Any supply, several kilogrammes, a slope or loads, a weak motor; the limit is just enough.

    Its load is within `plausibility_margin`, and it starts below `stall_duty`: more than that is a
    fault by those parameters.
    """
    while True:
        supply_v = random.uniform(5.5, 12.6)
        battery_v = random.choice((supply_v, 0.0))
        mass_kg = random.choice((0.8, random.uniform(0.8, 6.0)))
        settings = {"supply_v": supply_v, "battery_v": battery_v, "mass_kg": mass_kg}
        weakness = random.choice((1.0, 0.8))
        if weakness < 1:
            scaled = random.choice(("motor_scale", "torque_scale"))
            settings[f"{random.choice(('left', 'right'))}.{scaled}"] = weakness
        load_nm = random.choice((0.0, random.uniform(0, 0.03)))
        if random.random() < 0.5:
            share = load_nm / (mass_kg / 2 * GRAVITY * RADIUS_M)
            settings["slope_rad"] = random.choice((1, -1)) * math.asin(min(share, 0.25))
        else:
            sign = random.choice((1, -1))
            settings |= {f"{side}.load_nm": sign * load_nm for side in ("left", "right")}
        needed = needed_duty((STATIC_NM + load_nm) / weakness, supply_v)
        spare = needed_duty(SPARE * (STATIC_NM + load_nm) / weakness, supply_v)
        plausible = default("static_feedforward") + default("plausibility_margin")
        by_parameters = min(0.95 * plausible * supply_ratio(battery_v), default("stall_duty"))
        if needed < by_parameters and spare < 1:
            max_duty = random.choice((1.0, spare, random.uniform(spare, 1.0)))
            if spare <= active_limit(0.0, max_duty, battery_v):
                return Sound(settings, _drive_at_the_limit, max(max_duty, 0.1))


def needed_duty(torque_nm: float, supply_v: float) -> float:
    """The duty at which a standing wheel of the simulator has this torque; 2 if none."""
    amps = torque_nm / 0.09
    winding_ohm, drop_ohm, drop_v = 4.9, 1.2, 1.3
    volts = supply_v - drop_v - drop_ohm * amps
    return winding_ohm * amps / volts if volts > 0 else 2.0


def _drive_at_the_limit(robot: VirtualRobot, random: Random) -> None:
    linear = random.choice((0.02, -0.02, 0.4, -0.4, random.uniform(-0.4, 0.4)))
    turn = random.choice((0.0, 0.0, 0.15, random.uniform(-0.4, 0.4)))
    left, right = linear - turn, linear + turn
    if random.random() < 0.15:
        robot.drive_held(left, right, 0.3, random)
    robot.drive(left, right, random.uniform(0.2, 3.0))
    if random.random() < 0.1:
        robot.drive(0.0, 0.0, random.uniform(0.1, 1.0))
    if random.random() < 0.1:
        robot.run(1.0)
