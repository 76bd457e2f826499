"""A battery that is driven empty.

Driving back and forth at {SPEED_MPS} m/s, {LEG_S:g} s each way, in virtual time, on a battery of
{CAPACITY_MAH:g} mAh that falls from {FULL_V} to {FLAT_V} V and has {OHM} ohm; WARN below
{LEVELS.warn_v} V, LIMIT below {LEVELS.limit_v} V, STOP below {LEVELS.stop_v} V. A *dip* is too
short to change the level alone; its time counts and leaks away at a tenth of its pace. Stopped, the
battery rests at {LEVELS.warn_v} V, then it is charged.
"""

from __future__ import annotations

from dataclasses import replace

from harness import Report, run
from wheelwire import errors
from wheelwire.board import BatteryLevels
from wheelwire.drivers.mock import MockDriver
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.sensors import BatteryLevel, SensorEventCode

LEVELS = BatteryLevels(warn_v=7.0, limit_v=6.8, stop_v=6.6)
"""Levels for two lithium cells."""
BOUNDS_V = {
    BatteryLevel.OK: LEVELS.warn_v,
    BatteryLevel.WARN: LEVELS.limit_v,
    BatteryLevel.LIMIT: LEVELS.stop_v,
}
"""The voltage below which each level ends."""
FULL_V, FLAT_V = 7.5, 6.4
CAPACITY_MAH = 7
"""From full to flat: a battery that lasts minutes, so that the run is short."""
OHM = 0.3
"""Resistance of battery and leads."""
BATTERY = {
    "battery.capacity_ah": CAPACITY_MAH / 1000,
    "battery.fall_v": FULL_V - FLAT_V,
    **dict.fromkeys(("supply_v", "battery_v"), FULL_V),
    "supply_ohm": OHM,
}
STEP_S = 0.005
SPEED_MPS = 0.4
LEG_S = 2.0
SAG_S = 2.0
"""How long the voltage has to be below a bound, less a tenth of the time above it."""
RESTED, RESTED_S = 32 / 31, 0.25
"""So far above WARN, for so long, a voltage ends what was counted."""
SLOW_S = 0.3
"""How long a robot may take to slow down to its limit; it slews."""
CHARGED_S = 10.0
"""How long it has to be above it."""
REST_S = 60.0


class Drive:
    """A robot that is driven back and forth, and what was seen of its battery."""

    def __init__(self, robot: MockDriver) -> None:
        self.robot = robot
        self.now_s = 0.0
        self.level = BatteryLevel.OK
        self.rows: list[str] = []
        self.dips: list[float] = []
        self.counted: list[float] = []
        """For how long in all it was below a bound before the next level began."""
        self.fastest = dict.fromkeys(BatteryLevel, 0.0)
        self._since_s = self._rested_s = 0.0
        self._low_s = dict.fromkeys(BOUNDS_V, 0.0)
        self._sensed_v = FULL_V
        self._below_s = 0.0
        self._dips_of_level: list[float] = []
        self._events = robot.sensors.events()

    def rest_at(self, volts: float) -> None:
        """Let the battery recover, or charge it."""
        used = (FULL_V - volts) / (FULL_V - FLAT_V)
        self.robot.simulator.set("battery.used_ah", used * CAPACITY_MAH / 1000)

    def step(self) -> bool:
        """Drive for one step; returns whether the robot obeys."""
        forward = 1 if self.now_s % (2 * LEG_S) < LEG_S else -1
        try:
            self.robot.set_velocity(forward * SPEED_MPS, 0.0)
            obeys = True
        except errors.DeviceRefused:
            obeys = False
        self.robot.advance(STEP_S)
        self.now_s += STEP_S
        self._look(self.robot.simulator.get("true.supply_v"))
        return obeys

    def _look(self, sensed_v: float) -> None:
        speed = abs(self.robot.simulator.get("true.left_mps"))
        if self.now_s > self._since_s + SLOW_S:
            self.fastest[self.level] = max(self.fastest[self.level], speed)
        self._count(sensed_v)
        if sensed_v < BOUNDS_V.get(self.level, 0.0):
            self._below_s += STEP_S
        elif self._below_s:
            self._dips_of_level.append(self._below_s)
            self._below_s = 0.0
        for event in iter(self._events.poll, None):
            if event.code is SensorEventCode.BATTERY:
                self._change(BatteryLevel(event.value), sensed_v)

    def _count(self, sensed_v: float) -> None:
        above = sensed_v >= LEVELS.warn_v * RESTED
        self._rested_s = self._rested_s + STEP_S if above else 0.0
        for level, bound_v in BOUNDS_V.items():
            low_s = self._low_s[level]
            if sensed_v >= bound_v:
                low_s = max(0.0, low_s - STEP_S / 10)
            elif self._sensed_v < bound_v:  # from its first reading on
                low_s += STEP_S
            self._low_s[level] = 0.0 if self._rested_s >= RESTED_S else low_s
        self._sensed_v = sensed_v

    def _change(self, level: BatteryLevel, sensed_v: float) -> None:
        dips = self._dips_of_level
        if self.level in BOUNDS_V:
            self.counted.append(self._low_s[self.level])
        self._since_s = self.now_s
        longest = f"{max(dips):.2f} s" if dips else "-"
        used = self.robot.simulator.get("battery.used_ah") / CAPACITY_MAH * 1000
        open_v = FULL_V - (FULL_V - FLAT_V) * used
        self.rows.append(
            f"{self.level.name} to {level.name} | {self.now_s:.1f} s | {open_v:.2f} V | "
            f"{sensed_v:.2f} V | {len(dips)} | {longest} | {self.fastest[self.level]:.2f} m/s"
        )
        self.level = level
        self.dips += dips
        self._dips_of_level, self._below_s = [], 0.0


def charged(drive: Drive) -> tuple[float, bool]:
    """How long it is full before the level is OK; whether the robot drives after a clear."""
    began_s = drive.now_s
    drive.rest_at(FULL_V)
    while drive.level is not BatteryLevel.OK and drive.now_s < began_s + 2 * REST_S:
        drive.step()
    after_s = drive.now_s - began_s
    drive.robot.clear_fault()
    drive.robot.set_velocity(0.0, 0.0)
    drive.robot.advance(0.1)
    return after_s, all(drive.step() for _ in range(round(1 / STEP_S)))


def main(report: Report) -> None:
    """Print the table; the robot has to do what its levels say."""
    board = replace(load_board("l298n"), battery=34, peripherals=(LEVELS,))
    with MockDriver(realtime=False) as robot:
        half_mps = robot.parameters["max_velocity_mps"] / 2
        sim = robot.simulator
        for name, value in BATTERY.items():
            sim.set(name, value)
        robot.board.take_up(board)
        robot.set_velocity(0.0, 0.0)  # a board that was written disarms it
        robot.advance(0.1)
        drive = Drive(robot)
        while drive.step():
            pass
        robot.advance(0.5)  # until it stands
        at_m = sim.get("true.distance_m")
        drive.rest_at(LEVELS.warn_v)
        for _ in range(round(REST_S / STEP_S)):
            drive.step()
        moved_m = sim.get("true.distance_m") - at_m
        after_s, drives = charged(drive)
    report.table(
        "level | after | voltage | sensed | dips before | the longest | fastest before", drive.rows
    )
    limited_mps, longest_s = drive.fastest[BatteryLevel.LIMIT], max(drive.dips, default=0.0)
    sag, off_s = f"{SAG_S:g} s", max(abs(counted_s - SAG_S) for counted_s in drive.counted)
    for what, measured, limit, reached in (
        ("below a bound before its level began",
         " ".join(f"{counted_s:.2f}" for counted_s in drive.counted) + " s", sag, off_s < 0.1),
        ("the longest dip that changed no level", f"{longest_s:.2f} s", f"< {sag}",
         longest_s < SAG_S),
        ("fastest at LIMIT", f"{limited_mps:.2f} m/s", f"{half_mps:g} m/s and what it overshoots",
         limited_mps < half_mps * 1.1),
        (f"driven in {REST_S:g} s at rest", f"{moved_m:.3f} m", "0", moved_m == 0.0),
        ("charged for so long before it drives again", f"{after_s:.1f} s" if drives else "for ever",
         f"{CHARGED_S:g} s", drives and abs(after_s - CHARGED_S) < 0.2),
    ):  # fmt: skip
        report.target(what, measured, limit, reached)


run(main)
