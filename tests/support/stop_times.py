"""How long the wheels are still driven after a link failure; in virtual time, on the plant."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import count, repeat
from random import Random

from wheelwire.errors import WheelwireError
from wheelwire.simulation.bad_line import ImpairedLine
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import Hello, SetWheelVelocity

from .impaired_robot import ImpairedVirtualRobot

TTL_S = 0.3
SPEED_MPS = 0.25
COMMAND_MS = 20
PERIOD_US = 1000
"""The firmware's default control period."""
NOISE_BYTES_PER_S = 200_000
LATE_MS = 150
"""Delay after which the buffered bytes of a frozen host arrive."""
TIMEOUT_MS = 5000


@dataclass(frozen=True)
class StopTime:
    """One stop. Times are the device's.

    Attributes:
        failure_to_removed_us: From the failure to the drive's removal.
        late_us: From the deadline of the last setpoint to the drive's removal; None after a reset,
            which ends the drive at once and knows no deadline.
        removed_to_standstill_us: From then until both wheels stand.
        distance_m: Driven from the failure to standstill.
    """

    failure_to_removed_us: int
    late_us: int | None
    removed_to_standstill_us: int
    distance_m: float


def corrupt_everything(line: ImpairedLine) -> None:
    """Every byte of every frame, in both directions."""
    line.to_device.impairment.corrupt = line.to_host.impairment.corrupt = 1.0


def babble(line: ImpairedLine) -> None:
    """Endless random bytes to the device, and none of the host's."""
    impairment = line.to_device.impairment
    impairment.loss, impairment.noise_bytes_per_s = 1.0, NOISE_BYTES_PER_S


def frames_of_wrong_schema(encoder: Encoder, number: int) -> bytes:
    """A host of another release says hello, and sends a command although it is refused."""
    hello = Hello(77, PROTOCOL_VERSION, schema_hash() ^ 1)
    command = SetWheelVelocity(77, number, 1 << 60, SPEED_MPS, SPEED_MPS)
    return encoder.encode(hello) + encoder.encode(command)


Failure = Callable[[ImpairedVirtualRobot], Iterator[None]]
"""Fails a robot that is at speed, and goes on before each further millisecond."""


def killed(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """SIGKILL: the host sends nothing more; its bytes in transit arrive."""
    robot.host_runs = False
    yield


def frozen(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """SIGSTOP: as killed, but a buffer delivers the last setpoints late, twice."""
    robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S)
    buffered = robot.session.take_output()
    robot.host_runs = False
    for _ in range(2):
        yield from repeat(None, LATE_MS)
        robot.line.to_device.send(buffered, robot.now_us)


def cable_pulled(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """Nothing passes in either direction; the host's port disappears."""
    robot.unplug()
    yield from commands(robot)


def all_corrupted(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """The host continues."""
    corrupt_everything(robot.line)
    yield from commands(robot)


def babbling(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """The host continues."""
    babble(robot.line)
    yield from commands(robot)


def commands(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """The host keeps sending commands."""
    while True:
        yield
        with suppress(WheelwireError):
            robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S)
        yield from repeat(None, COMMAND_MS - 1)


def reset(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """The chip is reset; the host has gone."""
    robot.sim.reset()
    yield from killed(robot)


def only_pings(_: ImpairedVirtualRobot) -> Iterator[None]:
    """The application hangs; the link's thread continues."""
    yield


def wrong_schema(robot: ImpairedVirtualRobot) -> Iterator[None]:
    """A host of another release takes the port, is refused, and sends commands anyway."""
    robot.host_runs = False
    encoder = Encoder()
    for number in count(1):
        yield
        robot.line.to_device.send(frames_of_wrong_schema(encoder, number), robot.now_us)
        yield from repeat(None, COMMAND_MS - 1)


FAILURES: dict[str, Failure] = {
    "host killed": killed,
    "host frozen, its buffer late": frozen,
    "cable pulled": cable_pulled,
    "every byte corrupted": all_corrupted,
    "babbling line": babbling,
    "device reset": reset,
    "pings, no commands": only_pings,
    "host of a wrong schema": wrong_schema,
}


def stop_time(fail: Failure, seed: int) -> StopTime:
    """Bring a robot to speed, fail it, and measure. The seed sets the failure's phase."""
    random = Random(seed)
    robot = ImpairedVirtualRobot(seed, clock_ppm=random.uniform(-200, 200))
    robot.sim.advance_us(random.randrange(PERIOD_US))
    robot.open()
    robot.drive(SPEED_MPS, SPEED_MPS, 1.0)
    robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S + random.randrange(PERIOD_US) / 1e6)
    for _ in range(random.randrange(1, COMMAND_MS)):
        robot.step()
    sim = robot.sim
    failed_us, failed_m = sim.get("device_us"), sim.get("true.distance_m")
    deadline_us = sim.get("deadline_us")
    assert sim.get("drive_on") == 1
    failure = fail(robot)
    next(failure)
    is_reset = sim.get("device_us") < failed_us
    if is_reset:
        failed_us = sim.get("device_us")
    for _ in range(TIMEOUT_MS):
        next(failure, None)
        robot.step()
        if sim.get("stands_still") == 1 and sim.get("drive_on") == 0:
            break
    else:
        raise AssertionError("the robot drives on")
    removed_us = sim.get("drive_removed_us")
    # A setpoint that was in flight at the failure is the last one.
    deadline_us = max(deadline_us, sim.get("deadline_us"))
    return StopTime(
        failure_to_removed_us=round(removed_us - failed_us),
        late_us=None if is_reset else round(removed_us - deadline_us),
        removed_to_standstill_us=round(sim.get("standstill_us") - removed_us),
        distance_m=sim.get("true.distance_m") - failed_m,
    )
