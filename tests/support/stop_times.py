"""How long the wheels are still driven after a link failure; in virtual time, on the plant."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from random import Random

from wheelwire.errors import WheelwireError
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
WRONG_HASH = schema_hash() ^ 1


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


class Failure:
    """A failure while a robot is at speed, and its course in each millisecond after it.

    Args:
        robot: A robot at speed, commanded until now.
    """

    commands = False
    """The host keeps sending commands."""

    def __init__(self, robot: ImpairedVirtualRobot) -> None:
        self.robot = robot
        self.inject()

    def inject(self) -> None:
        """Inject the failure."""

    def go_on(self, _elapsed_ms: int) -> None:
        """Called before each further millisecond."""


class Killed(Failure):
    """SIGKILL: the host sends nothing more; its bytes in transit arrive."""

    def inject(self) -> None:
        self.robot.host_runs = False


class Frozen(Failure):
    """SIGSTOP: as killed, but a buffer delivers the last setpoints late, twice."""

    def inject(self) -> None:
        robot = self.robot
        robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S)
        self._buffered = robot.session.take_output()
        robot.host_runs = False

    def go_on(self, elapsed_ms: int) -> None:
        if elapsed_ms in (LATE_MS, 2 * LATE_MS):
            self.robot.line.to_device.send(self._buffered, self.robot.now_us)


class CablePulled(Failure):
    """Nothing passes in either direction; the host's port disappears."""

    commands = True

    def inject(self) -> None:
        self.robot.unplug()


class AllCorrupted(Failure):
    """Every byte of every frame is corrupted; the host continues."""

    commands = True

    def inject(self) -> None:
        line = self.robot.line
        line.to_device.impairment.corrupt = line.to_host.impairment.corrupt = 1.0


class Babbling(Failure):
    """Endless random bytes, and none of the host's."""

    commands = True

    def inject(self) -> None:
        impairment = self.robot.line.to_device.impairment
        impairment.loss, impairment.noise_bytes_per_s = 1.0, NOISE_BYTES_PER_S


class Reset(Failure):
    """The chip is reset; the host has gone."""

    def inject(self) -> None:
        self.robot.sim.reset()
        self.robot.host_runs = False


class OnlyPings(Failure):
    """The application hangs; the link's thread continues."""


class WrongSchema(Failure):
    """A host of another release takes the port, is refused, and sends commands anyway."""

    def inject(self) -> None:
        self.robot.host_runs = False
        self._encoder = Encoder()
        self._number = 0

    def go_on(self, elapsed_ms: int) -> None:
        if elapsed_ms % COMMAND_MS:
            return
        self._number += 1
        messages = (
            Hello(77, PROTOCOL_VERSION, WRONG_HASH),
            SetWheelVelocity(77, self._number, 1 << 60, SPEED_MPS, SPEED_MPS),
        )
        for message in messages:
            self.robot.line.to_device.send(self._encoder.encode(message), self.robot.now_us)


FAILURES: dict[str, Callable[[ImpairedVirtualRobot], Failure]] = {
    "host killed": Killed,
    "host frozen, its buffer late": Frozen,
    "cable pulled": CablePulled,
    "every byte corrupted": AllCorrupted,
    "babbling line": Babbling,
    "device reset": Reset,
    "pings, no commands": OnlyPings,
    "host of a wrong schema": WrongSchema,
}


def stop_time(kind: Callable[[ImpairedVirtualRobot], Failure], seed: int) -> StopTime:
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
    failure = kind(robot)
    is_reset = sim.get("device_us") < failed_us
    if is_reset:
        failed_us = sim.get("device_us")
    _run_until_still(robot, failure)
    removed_us = sim.get("drive_removed_us")
    # A setpoint that was in flight at the failure is the last one.
    deadline_us = max(deadline_us, sim.get("deadline_us"))
    return StopTime(
        failure_to_removed_us=round(removed_us - failed_us),
        late_us=None if is_reset else round(removed_us - deadline_us),
        removed_to_standstill_us=round(sim.get("standstill_us") - removed_us),
        distance_m=sim.get("true.distance_m") - failed_m,
    )


def _run_until_still(robot: ImpairedVirtualRobot, failure: Failure) -> None:
    for elapsed_ms in range(TIMEOUT_MS):
        failure.go_on(elapsed_ms)
        if failure.commands and elapsed_ms % COMMAND_MS == 0:
            with suppress(WheelwireError):
                robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S)
        robot.step()
        if robot.sim.get("stands_still") == 1 and robot.sim.get("drive_on") == 0:
            return
    raise AssertionError("the robot drives on")
