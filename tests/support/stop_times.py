"""How long the wheels are driven on when the link goes wrong: in virtual time, from the plant."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from random import Random

from wheelwire.errors import WheelwireError
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.schema import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.types import Hello, SetWheelVelocity

from .faulty_robot import FaultyRobot

TTL_S = 0.3
SPEED_MPS = 0.25
COMMAND_MS = 20
PERIOD_US = 1000
"""The firmware's control period, as it is by default."""
NOISE_BYTES_PER_S = 200_000
LATE_MS = 150
"""After it, what a frozen host had left in a buffer arrives."""
PATIENCE_MS = 5000
WRONG_HASH = schema_hash() ^ 1


@dataclass(frozen=True)
class StopTime:
    """One stop. Times are the device's.

    Attributes:
        struck_to_removed_us: From the blow to the drive's removal.
        late_us: From the deadline of the last setpoint to the drive's removal; None after a reset,
            which ends the drive at once and knows no deadline.
        removed_to_standstill_us: From then until both wheels stand.
        distance_m: Driven from the blow to standstill.
    """

    struck_to_removed_us: int
    late_us: int | None
    removed_to_standstill_us: int
    distance_m: float


class Blow:
    """What strikes a robot at speed, and what goes on from then, millisecond by millisecond.

    Args:
        robot: At speed, commanded until now.
    """

    commands = False
    """The host goes on commanding."""

    def __init__(self, robot: FaultyRobot) -> None:
        self.robot = robot
        self.strike()

    def strike(self) -> None:
        """It happens."""

    def go_on(self, _elapsed_ms: int) -> None:
        """Before each further millisecond."""


class Killed(Blow):
    """SIGKILL: the host says nothing more, and its bytes under way arrive."""

    def strike(self) -> None:
        self.robot.host_runs = False


class Frozen(Blow):
    """SIGSTOP: as killed, but a buffer hands on its last setpoints late, twice."""

    def strike(self) -> None:
        robot = self.robot
        robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S)
        self._buffered = robot.session.take_output()
        robot.host_runs = False

    def go_on(self, elapsed_ms: int) -> None:
        if elapsed_ms in (LATE_MS, 2 * LATE_MS):
            self.robot.line.to_device.send(self._buffered, self.robot.now_us)


class CablePulled(Blow):
    """Nothing passes either way; the host finds its port gone."""

    commands = True

    def strike(self) -> None:
        self.robot.unplug()


class AllCorrupted(Blow):
    """Every byte of every frame is another one; the host goes on."""

    commands = True

    def strike(self) -> None:
        line = self.robot.line
        line.to_device.faults.corrupt = line.to_host.faults.corrupt = 1.0


class Babbling(Blow):
    """Someone else's bytes without end, and none of the host's."""

    commands = True

    def strike(self) -> None:
        faults = self.robot.line.to_device.faults
        faults.loss, faults.noise_bytes_per_s = 1.0, NOISE_BYTES_PER_S


class Reset(Blow):
    """The chip starts anew; the host was commanding, and is gone."""

    def strike(self) -> None:
        self.robot.sim.reset()
        self.robot.host_runs = False


class OnlyPings(Blow):
    """The application hangs; the link's thread goes on."""


class WrongSchema(Blow):
    """A host of another release has taken the port: it says hello, and commands all the same."""

    def strike(self) -> None:
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


BLOWS: dict[str, Callable[[FaultyRobot], Blow]] = {
    "host killed": Killed,
    "host frozen, its buffer late": Frozen,
    "cable pulled": CablePulled,
    "every byte corrupted": AllCorrupted,
    "babbling line": Babbling,
    "device reset": Reset,
    "pings, no commands": OnlyPings,
    "host of a wrong schema": WrongSchema,
}


def stop_time(kind: Callable[[FaultyRobot], Blow], seed: int) -> StopTime:
    """Bring a robot to speed, strike, and measure. The seed moves the blow's phase."""
    random = Random(seed)
    robot = FaultyRobot(seed, clock_ppm=random.uniform(-200, 200))
    robot.sim.advance_us(random.randrange(PERIOD_US))
    robot.open()
    robot.drive(SPEED_MPS, SPEED_MPS, 1.0)
    robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S + random.randrange(PERIOD_US) / 1e6)
    for _ in range(random.randrange(1, COMMAND_MS)):
        robot.step()
    sim = robot.sim
    struck_us, struck_m = sim.get("device_us"), sim.get("true.distance_m")
    deadline_us = sim.get("deadline_us")
    assert sim.get("drive_on") == 1
    blow = kind(robot)
    is_reset = sim.get("device_us") < struck_us
    if is_reset:
        struck_us = sim.get("device_us")
    _run_until_still(robot, blow)
    removed_us = sim.get("drive_removed_us")
    # A setpoint that was under way at the blow is the last one.
    deadline_us = max(deadline_us, sim.get("deadline_us"))
    return StopTime(
        struck_to_removed_us=round(removed_us - struck_us),
        late_us=None if is_reset else round(removed_us - deadline_us),
        removed_to_standstill_us=round(sim.get("standstill_us") - removed_us),
        distance_m=sim.get("true.distance_m") - struck_m,
    )


def _run_until_still(robot: FaultyRobot, blow: Blow) -> None:
    for elapsed_ms in range(PATIENCE_MS):
        blow.go_on(elapsed_ms)
        if blow.commands and elapsed_ms % COMMAND_MS == 0:
            with suppress(WheelwireError):
                robot.set_velocity(SPEED_MPS, SPEED_MPS, TTL_S)
        robot.step()
        if robot.sim.get("stands_still") == 1 and robot.sim.get("drive_on") == 0:
            return
    raise AssertionError("the robot drives on")
