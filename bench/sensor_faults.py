"""How long the firmware takes to name a sensor's fault, and whether the wheels notice it."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from random import Random
from typing import NamedTuple, TypeAlias

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, output_folder, table, table_of_targets
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
"""So long an echo is waited for."""
ZERO_MS = 100
"""So long a divider reads nothing before that is no dip."""
BUSY_MS = 250
"""So long an HC-SR04's output may stay high where nothing reflects its sound."""
FROZEN_MS = (IMUS[SensorChip.MPU6050].frozen_samples + 1) * IMU_MS
WATCH_S = 0.5
RECOVER_S = 1.2
SPEED_MPS = 0.2
DRIVE_S = 1.0

BUS = {"sda": 16, "scl": 17}
MOUNTING = {"forward": "y", "up": "z"}
SHUNT = {"shunt_mohm": 100}
Peripherals: TypeAlias = dict[str, object]
WITH_EDGE: Peripherals = {
    "imu": {"chip": "mpu6050", **BUS, "interrupt": 35, **MOUNTING},
    "power": {"chip": "ina219", **BUS, **SHUNT},
    "inputs": {"analog_1": {"pin": 39}, "bumper_front": {"pin": 34, "pull": "external"}},
    "ranges": {"front": {"chip": "hc-sr04", "trigger": 21, "echo": 36}},
}
POLLED: Peripherals = {
    "imu": {"chip": "lsm6ds3", **BUS, **MOUNTING},
    "power": {"chip": "ina226", **BUS, **SHUNT},
}
DIVIDED: Peripherals = {"battery": {"pin": 34, "divider": 4.0}, "power": {}}

METHOD = f"""\
Each fault at {TIMES} random moments, in virtual time: the same at every run. From the fault to the
control step in which the sensor is STALE, and to the one in which the fault has its name: the
longest times, and the bounds. These are two periods of the sensor and {STEP_MS} ms for the control
step; of an IMU that repeats itself as many samples as its table says and one more. The output of an
HC-SR04 that stays high looks for {ECHO_MS:g} ms as if an echo were on its way, and may be so for
{BUSY_MS} ms where nothing reflects the sound. *The wheels* drive at {SPEED_MPS} m/s meanwhile: *as
without it* if the true pose after {DRIVE_S:g} s is, to the last digit, that of a robot without the
fault, and no control step was late. An open bumper may be a broken wire or a wall: it has to stop
them.
"""


class Fault(NamedTuple):
    """What happens to a sensor, and how the firmware has to name it."""

    sensor: str
    what: str
    variable: str
    channel: str
    state: SensorState | None
    """None: an input that triggers."""
    stale_ms: float
    """Within this its samples are no longer used."""
    named_ms: float
    """Within this it has its name."""
    value: float = 1.0


def of_chip(sensor: str, channel: str, bound_ms: float) -> list[Fault]:
    """Those of any chip on a bus."""
    return [
        Fault(sensor, what, variable, channel, state, bound_ms, bound_ms)
        for what, variable, state in (
            ("its plug is off", f"{channel}.absent", SensorState.ABSENT),
            ("its bus hangs", "imu.bus_hung", SensorState.HUNG),
            ("it lost its settings", f"{channel}.reset", SensorState.RESET),
        )
    ]


def of_imu(sensor: str) -> list[Fault]:
    """Those of any IMU."""
    frozen = Fault(
        *(sensor, "it repeats itself", "imu.freeze", "imu"),
        *(SensorState.FROZEN, 2 * IMU_MS, FROZEN_MS),
    )
    return [*of_chip(sensor, "imu", 2 * IMU_MS), frozen]


NO_ECHO = Fault(
    sensor="HC-SR04",
    what="its plug is off",
    variable="range.absent",
    channel="range.front",
    state=SensorState.ABSENT,
    stale_ms=2 * RANGE_MS,
    named_ms=2 * RANGE_MS,
)
STUCK_ECHO = Fault(
    sensor="HC-SR04",
    what="its echo stays high",
    variable="range.hung",
    channel="range.front",
    state=SensorState.HUNG,
    stale_ms=ECHO_MS + 2 * RANGE_MS,
    named_ms=BUSY_MS + 2 * RANGE_MS,
)
NO_EDGE = Fault(
    sensor="MPU6050",
    what="the wire of its interrupt",
    variable="imu.interrupt_lost",
    channel="imu",
    state=SensorState.MISSED,
    stale_ms=2 * IMU_MS,
    named_ms=2 * IMU_MS,
)
NO_READING = Fault(
    sensor="analogue input",
    what="no reading",
    variable="analog.failed",
    channel="analog_1",
    state=SensorState.MISSED,
    stale_ms=2 * ANALOG_MS,
    named_ms=2 * ANALOG_MS,
)
NO_VOLTAGE = Fault(
    sensor="battery's divider",
    what="its wire is broken",
    variable="battery_v",
    channel="battery",
    state=SensorState.ZERO,
    stale_ms=ZERO_MS,
    named_ms=ZERO_MS,
    value=0.0,
)
OPEN_BUMPER = Fault(
    sensor="bumper",
    what="its wire is broken",
    variable="bumper.front",
    channel="bumper.front",
    state=None,
    stale_ms=0.0,
    named_ms=0.0,
)
BOARDS: tuple[tuple[Peripherals, list[Fault]], ...] = (
    (
        WITH_EDGE,
        [
            *of_imu("MPU6050"),
            NO_EDGE,
            *of_chip("INA219", "power", 2 * POWER_MS),
            *(NO_ECHO, STUCK_ECHO),
            NO_READING,
            OPEN_BUMPER,
        ],
    ),
    (POLLED, [*of_imu("LSM6DS3"), *of_chip("INA226", "power", 2 * POWER_MS)]),
    (DIVIDED, [NO_VOLTAGE]),
)


def board_with(peripherals: Peripherals) -> Configuration:
    """The simulated board with these."""
    return parse_board(
        {**board_mapping(load_board("l298n")), "module": "wroom-32", "led": None, **peripherals}
    )


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
    """From a moment to the first of these; infinite if there is none."""
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


def rows_of(
    peripherals: Peripherals, faults: Iterable[Fault]
) -> Iterable[tuple[list[str], bool, bool]]:
    """A row for each fault of a board, whether it was named in time, and what the wheels did."""
    board, random = board_with(peripherals), Random(1)
    calm = drive(board, None)
    for fault in faults:
        with opened(board) as robot:
            stale, named = longest_ms(robot, fault, random)
        stale_bound, named_bound = fault.stale_ms + STEP_MS, fault.named_ms + STEP_MS
        same = drive(board, fault) == calm
        row = [
            *(fault.sensor, fault.what, "triggered" if fault.state is None else fault.state.name),
            *(f"{stale:.1f} ms", f"{stale_bound:g} ms", f"{named:.1f} ms", f"{named_bound:g} ms"),
            "as without it" if same else "stop",
        ]
        in_time = stale <= stale_bound and named <= named_bound
        yield row, in_time, same == (fault.state is not None)


def main() -> int:
    """Print the table; returns 1 if a fault had its name too late, or the wheels noticed one."""
    output_folder(__doc__)
    found = [row for peripherals, faults in BOARDS for row in rows_of(peripherals, faults)]
    in_time, right = sum(row[1] for row in found), sum(row[2] for row in found)
    header = (
        *("sensor", "fault", "named", "STALE after", "at most", "named after", "at most"),
        "the wheels",
    )
    targets = [
        Target(what, f"{count}", f"{len(found)}", count == len(found))
        for what, count in (
            ("STALE and named within the bounds", in_time),
            ("the wheels do as they should", right),
        )
    ]
    rows = table(header, (row for row, *_ in found))
    sys.stdout.write(f"## Faults of sensors\n\n{METHOD}\n{rows}\n{table_of_targets(targets)}")
    return 0 if all(target.reached for target in targets) else 1


if __name__ == "__main__":
    sys.exit(main())
