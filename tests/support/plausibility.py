"""Encoders that lose edges, and healthy robots that only look as if theirs did; in virtual time."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import NamedTuple

from wheelwire.errors import DeviceRefused
from wheelwire_protocol.codes import Fault, SupervisorState

from .virtual import VirtualRobot

PERIOD_S = 0.02
MEASURED_V = 7.4


class Outcome(NamedTuple):
    """What became of a robot with a wheel that fails, until the fault or the end of the run."""

    faults: Fault
    seconds: float
    distance_m: float
    """Distance that the wheel rolled."""
    top_mps: float
    """The wheel's highest speed."""
    at_limit_s: float
    """Since it reached its limit; 0: it did not."""


def until_fault(
    robot: VirtualRobot,
    side: str,
    setpoint: tuple[float, float],
    timeout_s: float,
    limit: float = 1.0,
) -> Outcome:
    """Drive with a setpoint of the wheel on this side and the other one; `limit` is its duty's."""
    left, right = setpoint if side == "left" else setpoint[::-1]
    began_us, limit_us, top = robot.now_us, 0, 0.0
    before = robot.sim.get(f"true.{side}_ticks")
    while not robot.sim.get("faults") and robot.now_us < began_us + timeout_s * 1e6:
        with suppress(DeviceRefused):
            robot.drive(left, right, PERIOD_S)
        top = max(top, abs(robot.sim.get(f"true.{side}_mps")))
        if not limit_us and abs(robot.sim.get(f"{side}.duty")) >= limit:
            limit_us = robot.now_us
    return Outcome(
        Fault(int(robot.sim.get("faults"))),
        (robot.now_us - began_us) * 1e-6,
        abs(robot.sim.get(f"true.{side}_ticks") - before) / 360 * 2 * math.pi * 0.033,
        top,
        (robot.now_us - limit_us) * 1e-6 if limit_us else 0.0,
    )


def fail(
    failure: dict[str, float],
    side: str,
    target_mps: float,
    driven_s: float = 0.0,
    battery_v: float = MEASURED_V,
    supply_v: float = MEASURED_V,
    timeout_s: float = 3.0,
) -> Outcome:
    """Drive straight, and let the encoder of one wheel fail after `driven_s`.

    Args:
        failure: Simulator variables of one side, such as `{"encoder_lost": 0.9}`.
        side: Which wheel's.
        target_mps: The setpoint.
        driven_s: 0: it fails before the first setpoint.
        battery_v: Battery voltage measured by the firmware; 0: not measured.
        supply_v: True supply of the motors.
        timeout_s: How long to wait for a fault.
    """
    robot = VirtualRobot(1, supply_v=supply_v, battery_v=battery_v).open()
    robot.drive(target_mps, target_mps, driven_s)
    for name, value in failure.items():
        robot.sim.set(f"{side}.{name}", value)
    return until_fault(robot, side, (target_mps, target_mps), timeout_s)


RUN_S = 12.0
"""Then another robot starts."""


class Trip(NamedTuple):
    """A fault that healthy driving must not raise."""

    run: int
    faults: Fault
    max_duty: float
    settings: dict[str, float]


class Sound(NamedTuple):
    """A robot that is sound, and how it drives."""

    settings: dict[str, float]
    drive: Callable[[VirtualRobot, Random], None]
    max_duty: float = 1.0


def trips(seconds: float, seed: int, begin: Callable[[Random], Sound]) -> list[Trip]:
    """Sound robots that drive at random for so long: those that tripped a fault."""
    random = Random(seed)
    found = []
    for run in range(math.ceil(seconds / RUN_S)):
        sound = begin(random)
        robot = VirtualRobot(1, **sound.settings).open()
        robot.set_parameter("max_duty", sound.max_duty)
        with suppress(DeviceRefused):
            while robot.now_us < RUN_S * 1e6 and not robot.sim.get("faults"):
                sound.drive(robot, random)
        if robot.sim.get("faults") or robot.state() is SupervisorState.FAULT:
            faults = Fault(int(robot.sim.get("faults")))
            found.append(Trip(run, faults, sound.max_duty, sound.settings))
    return found


def healthy(seconds: float, seed: int, battery_measured: bool) -> list[Trip]:
    """Drive at random: starts, reversals, curves, crawling, loads, slopes, obstacles of 0.3 s.

    Each robot has another battery, load and slope. Without a measured battery there is a load or a
    slope, but not both.
    """
    return trips(
        seconds, seed, lambda random: Sound(_conditions(random, battery_measured), _drive_somehow)
    )


def healthy_in_bursts(seconds: float, seed: int) -> list[Trip]:
    """As `healthy`, in starts and stops of some tenths of a second, on a supply that sags."""
    return trips(seconds, seed, _in_bursts)


def _in_bursts(random: Random) -> Sound:
    settings = _conditions(random, True) | {"supply_ohm": random.choice((0.0, 0.3))}
    longest_s, pause_s = random.choice((0.1, 0.3, 0.8)), random.choice((0.03, 0.3, 1.0))

    def drive(robot: VirtualRobot, random: Random) -> None:
        linear = random.choice((0.02, 0.1, random.uniform(-0.4, 0.4)))
        robot.drive(linear, linear, random.uniform(0.03, longest_s))
        if random.random() < 0.5:
            robot.stop()
            robot.run(random.uniform(0.0, pause_s))
        else:
            robot.drive(0.0, 0.0, random.uniform(0.0, pause_s))

    return Sound(settings, drive)


def _conditions(random: Random, battery_measured: bool) -> dict[str, float]:
    volts = random.uniform(5.5, 9.0)
    settings = {"supply_v": volts, "battery_v": volts if battery_measured else 0.0}
    sloping = random.random() < 0.5
    if sloping:
        settings["slope_rad"] = random.uniform(-0.0997, 0.0997)
    if battery_measured or not sloping:
        for side in ("left", "right"):
            settings[f"{side}.load_nm"] = random.choice((0.0, 0.02, random.uniform(-0.02, 0.02)))
    return settings


def _drive_somehow(robot: VirtualRobot, random: Random) -> None:
    linear = random.uniform(-0.4, 0.4)
    if random.random() < 0.2:
        linear = random.uniform(0.02, 0.07)
    turn = 0.0 if random.random() < 0.5 else random.uniform(-0.15, 0.15)
    left, right = linear - turn, linear + turn
    if random.random() < 0.15:
        robot.drive_held(left, right, 0.3, random)
    robot.drive(left, right, random.uniform(0.2, 1.7))
