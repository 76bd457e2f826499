"""A battery that is driven empty: when the robot warns, slows down, stops and stays so."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, output_folder, table, table_of_targets
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
CAPACITY_AH = 0.007
"""From full to flat: a battery of minutes, so that the run is short."""
OHM = 0.3
"""Resistance of battery and leads."""
BATTERY = {
    "battery.capacity_ah": CAPACITY_AH,
    "battery.fall_v": FULL_V - FLAT_V,
    **dict.fromkeys(("supply_v", "battery_v"), FULL_V),
    "supply_ohm": OHM,
}
STEP_S = 0.02
SPEED_MPS = 0.4
LEG_S = 2.0
SAG_S = 2.0
"""So long the voltage has to be below a bound."""
CHARGED_S = 10.0
"""So long it has to be above."""
REST_S = 60.0

METHOD = f"""\
The simulated robot drives back and forth at {SPEED_MPS} m/s, {LEG_S:g} s each way, in virtual time:
the same at every run. The motors' current empties its battery of {CAPACITY_AH * 1000:g} mAh, whose
voltage falls evenly from {FULL_V} to {FLAT_V} V; with a resistance of {OHM} ohm it sags further
under that current, most when the motors start. The robot warns below {LEVELS.warn_v} V, slows down
below {LEVELS.limit_v} V and stops below {LEVELS.stop_v} V. A *dip* is a time below the bound of the
next level that ended before that level began. Stopped, the battery rests at {LEVELS.warn_v} V; then
it is charged.
"""


class Drive:
    """A robot that is driven back and forth, and what was seen of its battery."""

    def __init__(self, robot: MockDriver) -> None:
        self.robot = robot
        self.now_s = 0.0
        self.level = BatteryLevel.OK
        self.rows: list[list[str]] = []
        self.dips: list[float] = []
        self.shortest_s = float("inf")
        """The shortest time below a bound before its level began."""
        self.fastest = dict.fromkeys(BatteryLevel, 0.0)
        self._below_s = 0.0
        self._dips_of_level: list[float] = []
        self._events = robot.sensors.events()

    @property
    def open_v(self) -> float:
        """The battery's voltage without a load."""
        used = self.robot.simulator.get("battery.used_ah") / CAPACITY_AH
        return FULL_V - (FULL_V - FLAT_V) * used

    def rest_at(self, volts: float) -> None:
        """Let the battery recover, or charge it."""
        used = (FULL_V - volts) / (FULL_V - FLAT_V)
        self.robot.simulator.set("battery.used_ah", used * CAPACITY_AH)

    def step(self) -> bool:
        """Drive for one step; returns whether the robot obeys."""
        sim = self.robot.simulator
        forward = 1 if self.now_s % (2 * LEG_S) < LEG_S else -1
        try:
            self.robot.set_velocity(forward * SPEED_MPS, 0.0)
            obeys = True
        except errors.DeviceRefused:
            obeys = False
        self.robot.advance(STEP_S)
        self.now_s += STEP_S
        self._look(sim.get("true.supply_v"))
        return obeys

    def _look(self, sensed_v: float) -> None:
        speed = abs(self.robot.simulator.get("true.left_mps"))
        self.fastest[self.level] = max(self.fastest[self.level], speed)
        if sensed_v < BOUNDS_V.get(self.level, 0.0):
            self._below_s += STEP_S
        elif self._below_s:
            self._dips_of_level.append(self._below_s)
            self._below_s = 0.0
        for event in iter(self._events.poll, None):
            if event.code is SensorEventCode.BATTERY:
                self._change(BatteryLevel(event.value), sensed_v)

    def _change(self, level: BatteryLevel, sensed_v: float) -> None:
        dips = self._dips_of_level
        if self.level in BOUNDS_V:
            self.shortest_s = min(self.shortest_s, self._below_s)
        longest = f"{max(dips):.2f} s" if dips else "-"
        change = f"{self.level.name} to {level.name}"
        self.rows.append(
            [
                *(change, f"{self.now_s:.1f} s", f"{self.open_v:.2f} V", f"{sensed_v:.2f} V"),
                *(f"{len(dips)}", longest, f"{self.fastest[self.level]:.2f} m/s"),
            ]
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


def main() -> int:
    """Print the table; returns 1 if the robot did not do what its levels say."""
    output_folder(__doc__)
    board = replace(load_board("l298n"), battery=34, peripherals=(LEVELS,))
    with MockDriver(realtime=False) as robot:
        half_mps = robot.parameters["max_velocity_mps"] / 2
        sim = robot.simulator
        for name, value in BATTERY.items():
            sim.set(name, value)
        robot.board.take_up(board)
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
    header = ("level", "after", "voltage", "sensed", "dips before", "the longest", "fastest before")
    limited_mps, longest_s = drive.fastest[BatteryLevel.LIMIT], max(drive.dips)
    targets = [
        Target(
            "below a bound before its level began",
            f"{drive.shortest_s:.2f} s",
            f"{SAG_S:g} s",
            abs(drive.shortest_s - SAG_S) < 0.1,
        ),
        Target(
            "the longest dip that changed no level",
            f"{longest_s:.2f} s",
            f"< {SAG_S:g} s",
            longest_s < SAG_S,
        ),
        Target(
            "fastest at LIMIT",
            f"{limited_mps:.2f} m/s",
            f"{half_mps:g} m/s and what it overshoots",
            limited_mps < half_mps * 1.1,
        ),
        Target(
            f"driven in {REST_S:g} s at rest",
            f"{moved_m:.3f} m",
            "0",
            moved_m == 0.0,
        ),
        Target(
            "charged for so long before it drives again",
            f"{after_s:.1f} s" if drives else "for ever",
            f"{CHARGED_S:g} s",
            drives and abs(after_s - CHARGED_S) < 0.2,
        ),
    ]
    sys.stdout.write(
        f"## A battery that is driven empty\n\n{METHOD}\n{table(header, drive.rows)}\n"
        f"{table_of_targets(targets)}"
    )
    return 0 if all(target.reached for target in targets) else 1


if __name__ == "__main__":
    sys.exit(main())
