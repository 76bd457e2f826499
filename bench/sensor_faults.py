"""Faults of sensors.

Each fault at {TIMES} random moments, in virtual time, while the robot drives at {SPEED_MPS} m/s:
the longest time in ms until the sensor is STALE, of the most allowed, and until the fault has its
name, if that is later. Allowed are two periods of the sensor and two control steps of {STEP_MS} ms,
one to take a reading that is on its way, one to find none; more for a frozen IMU and an echo that
stays high. A bumper's broken wire must stop the robot within a step; with any other fault it must
drive on as a robot without the fault, to the last digit.

ABSENT: its plug is off. HUNG: its bus hangs, or its echo stays high. RESET: it lost its settings.
FROZEN: it repeats itself. MISSED: the wire of its interrupt is off, or it gives no reading. ZERO:
its wire is broken.
"""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from typing import NamedTuple, TypeAlias

from harness import Report, run
from wheelwire import SensorEvent, SensorEventCode, SensorState
from wheelwire.board import Configuration
from wheelwire.drivers.mock import MockDriver, VirtualMockDriver
from wheelwire.tools.files.board import board_mapping, load_board, parse_board
from wheelwire_protocol.sensors import IMUS, RANGES, SensorChip

TIMES = 20
STEP_MS = 1
"""A control step, in which what a task found is taken."""
HC_SR04 = RANGES[SensorChip.HC_SR04]
IMU_MS, POWER_MS, RANGE_MS, ANALOG_MS = 5, 100, HC_SR04.period_us / 1000, 100
"""The periods."""
ECHO_MS = (HC_SR04.start_us + HC_SR04.nothing_us) / 1000
"""The longest wait for an echo."""
ZERO_MS = 100
"""How long a divider may read 0 mV, as in a dip."""
BUSY_MS = 250
"""The longest that an HC-SR04's output stays high without an echo."""
FROZEN_MS = (IMUS[SensorChip.MPU6050].frozen_samples + 1) * IMU_MS
WATCH_S = 0.5
RECOVER_S = 1.2
SPEED_MPS = 0.2
DRIVE_S = 1.0


class Fault(NamedTuple):
    """What happens to a sensor, and how the firmware has to name it."""

    sensor: str
    variable: str
    channel: str
    state: SensorState | None
    """None: the fault triggers an input."""
    stale_ms: float
    """Within this its samples are no longer used."""
    named_ms: float
    """Within this it has its name."""
    value: float = 1.0


def of_chip(sensor: str, channel: str, ms: float) -> list[Fault]:
    """Faults of any chip on a bus."""
    return [
        Fault(sensor, f"{channel}.absent", channel, SensorState.ABSENT, ms, ms),
        Fault(sensor, "imu.bus_hung", channel, SensorState.HUNG, ms, ms),
        Fault(sensor, f"{channel}.reset", channel, SensorState.RESET, ms, ms),
    ]


def of_imu(sensor: str) -> list[Fault]:
    """Faults of any IMU."""
    ms = 2 * IMU_MS
    frozen = SensorState.FROZEN
    repeats = Fault(sensor, "imu.freeze", "imu", frozen, ms, FROZEN_MS)
    return [*of_chip(sensor, "imu", ms), repeats]


MISSED, RANGE, BUS = SensorState.MISSED, "range.front", {"sda": 16, "scl": 17}
MOUNTED_IMU = {**BUS, "forward": "y", "up": "z"}
SHUNT = {**BUS, "shunt_mohm": 100}
Peripherals: TypeAlias = dict[str, object]
WITH_EDGE: Peripherals = {
    "imu": {"chip": "mpu6050", **MOUNTED_IMU, "interrupt": 35},
    "power": {"chip": "ina219", **SHUNT},
    "inputs": {"analog_1": {"pin": 39}, "bumper_front": {"pin": 34, "pull": "external"}},
    "ranges": {"front": {"chip": "hc-sr04", "trigger": 21, "echo": 36}},
}
POLLED: Peripherals = {
    "imu": {"chip": "lsm6ds3", **MOUNTED_IMU},
    "power": {"chip": "ina226", **SHUNT},
}
DIVIDED: Peripherals = {"battery": {"pin": 34, "divider": 4.0}, "power": {}}
BOARDS: tuple[tuple[Peripherals, list[Fault]], ...] = (
    (WITH_EDGE, [
        *of_imu("MPU6050"),
        Fault("MPU6050", "imu.interrupt_lost", "imu", MISSED,
              2 * IMU_MS, 2 * IMU_MS),
        *of_chip("INA219", "power", 2 * POWER_MS),
        Fault("HC-SR04", "range.absent", RANGE, SensorState.ABSENT,
              2 * RANGE_MS, 2 * RANGE_MS),
        Fault("HC-SR04", "range.hung", RANGE, SensorState.HUNG,
              ECHO_MS + 2 * RANGE_MS, BUSY_MS + 2 * RANGE_MS),
        Fault("analogue input", "analog.failed", "analog_1", MISSED,
              2 * ANALOG_MS, 2 * ANALOG_MS),
        Fault("bumper", "bumper.front", "bumper.front", None, 0.0, 0.0),
    ]),
    (POLLED, [*of_imu("LSM6DS3"), *of_chip("INA226", "power", 2 * POWER_MS)]),
    (DIVIDED, [Fault("battery's divider", "battery_v", "battery",
                     SensorState.ZERO, ZERO_MS, ZERO_MS, value=0.0)]),
)  # fmt: skip


def opened(board: Configuration) -> VirtualMockDriver:
    """A simulated robot with its sensors on."""
    robot = MockDriver(realtime=False)
    assert isinstance(robot, VirtualMockDriver)
    robot.board.take_up(board)
    robot.sensors.start()
    robot.advance(RECOVER_S)
    return robot


def longest_ms(robot: VirtualMockDriver, fault: Fault, random: Random) -> tuple[float, float]:
    """The longest times until the sensor is STALE, and until the fault has its name."""
    sim = robot.simulator
    before, stale, named = sim.get(fault.variable), 0.0, 0.0
    for _ in range(TIMES):
        robot.advance(random.randrange(200) * 1e-3)
        sim.advance_us(random.randrange(1000))
        began_us = sim.get("device_us")
        events = robot.sensors.events()
        sim.set(fault.variable, fault.value)
        robot.advance(WATCH_S)
        seen = [event for event in iter(events.poll, None) if event.name == fault.channel]
        stale = max(stale, ms_until(began_us, (one for one in seen if one.is_warning)))
        named = max(named, ms_until(began_us, (one for one in seen if names(one, fault))))
        sim.set(fault.variable, before)
        robot.advance(RECOVER_S)
    return stale, named


def ms_until(began_us: float, events: Iterable[SensorEvent]) -> float:
    """From a moment to the first of these; infinite without one."""
    return next(((event.t_us - began_us) / 1e3 for event in events), float("inf"))


def names(event: SensorEvent, fault: Fault) -> bool:
    """Whether it is the one that the fault has to cause."""
    if fault.state is None:
        return event.code is SensorEventCode.TRIGGERED
    return event.code is SensorEventCode.STATE and event.value == fault.state


def drive(board: Configuration, fault: Fault | None) -> tuple[float, ...]:
    """Where the robot is after a drive with a fault, and its late control steps."""
    with opened(board) as robot:
        sim = robot.simulator
        robot.set_velocity(SPEED_MPS, 0.0)
        robot.advance(0.1)
        if fault is not None:
            sim.set(fault.variable, fault.value)
        for _ in range(round(DRIVE_S / 0.1)):
            robot.set_velocity(SPEED_MPS, 0.0)
            robot.advance(0.1)
        pose = (sim.get("true.x_m"), sim.get("true.y_m"), sim.get("true.heading_rad"))
        return (*pose, robot.read().overruns)


def main(report: Report) -> None:
    """Print the table; each fault has to have its name in time, and no wheel may notice it."""
    cells: dict[str, list[str]] = {}
    late, wrong = 0, 0
    for peripherals, faults in BOARDS:
        bare = {**board_mapping(load_board("l298n")), "module": "wroom-32", "led": None}
        board, random = parse_board({**bare, **peripherals}), Random(1)
        calm = drive(board, None)
        for fault in faults:
            with opened(board) as robot:
                stale, named = longest_ms(robot, fault, random)
            steps_ms = STEP_MS if fault.state is None else 2 * STEP_MS
            stale_bound, named_bound = fault.stale_ms + steps_ms, fault.named_ms + steps_ms
            same = drive(board, fault) == calm
            late += stale > stale_bound or named > named_bound
            wrong += same != (fault.state is not None)
            name = "triggered" if fault.state is None else fault.state.name
            cell = f"{name} {stale:.1f} of {stale_bound:g}"
            if (named, named_bound) != (stale, stale_bound):
                cell += f" (named {named:.1f} of {named_bound:g})"
            cells.setdefault(fault.sensor, []).append(cell)
    report.items(f"{name} | {', '.join(of)}" for name, of in cells.items())
    total = sum(map(len, cells.values()))
    report.equal("STALE and named within the bounds", total - late, total)
    report.equal("the wheels do as they should", total - wrong, total)


run(main)
