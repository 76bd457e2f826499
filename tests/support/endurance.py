"""Runs with many resets and unpluggings in virtual time, compared with the plant tick by tick."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

from wheelwire.errors import WheelwireError
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.session import Session
from wheelwire.motion.kinematics import DifferentialDrive
from wheelwire.motion.odometry import Odometry
from wheelwire.samples import WheelSample, tick_difference
from wheelwire.simulation.bad_line import LineProfile

from .host_samples import remeasured
from .impaired_robot import ImpairedVirtualRobot
from .virtual import STEP_US

STATE_HZ = 1000
COMMAND_MS = 20
TTL_S = 0.3
TOP_MPS = 0.3
TRUTH_KEPT = 2000
"""Milliseconds, longer than a sample takes to arrive."""
GEOMETRY = DifferentialDrive(0.2, 0.033, 360, 0.6)
"""The simulator's default."""
FIRST_WRAP_US = 1 << 32
"""Modulus of the unsigned time in a state frame."""
FIRST_WRAP_TICKS = 1 << 31
"""Modulus of the signed ticks in a state frame."""


class Unseen(NamedTuple):
    """The motion during a reset, which the host cannot see."""

    milliseconds: float
    distance_m: float
    """Travel of the middle between the wheels; negative backwards."""


@dataclass
class Account:
    """The results of a run.

    Attributes:
        samples: Number of samples compared with the plant.
        wrong: Samples whose ticks differ from the plant's at the latch, counted from the boot.
        jumps: Resets at which the odometry moved.
        unseen: For each reset, the true motion between the last sample before it and the
            first after it.
        seen_ticks: What the host's running count says that the left wheel did.
        true_ticks: What the left wheel did between the first sample and the last.
        unseen_left: The left wheel's part of it that fell into resets.
    """

    samples: int = 0
    wrong: int = 0
    jumps: int = 0
    unseen: list[Unseen] = field(default_factory=list)
    seen_ticks: int = 0
    true_ticks: int = 0
    unseen_left: int = 0

    @property
    def unaccounted(self) -> int:
        """Ticks lost or invented in the host's running count."""
        return self.true_ticks - self.unseen_left - self.seen_ticks


class EnduranceRun(ImpairedVirtualRobot):
    """A robot that is driven at random, and its bookkeeping.

    The device's clock runs with simulated time, so that each control step, and with it each latch,
    falls on the end of a simulated millisecond: the plant is read at the very same moment.

    Args:
        seed: Of the run.
        profile: What is wrong with the line.
        settings: The simulator's variables.
    """

    def __init__(self, seed: int, profile: LineProfile | None = None, /, **settings: float) -> None:
        super().__init__(seed, profile, **settings)
        self.session = Session(lambda: self.random.getrandbits(32), STATE_HZ)
        self.account = Account()
        self._latest_sample = LatestSample()
        self._odometry = Odometry(GEOMETRY)
        self._truth: dict[tuple[int, int], tuple[int, int]] = {}
        self._zero: tuple[int, int, int] | None = None
        self._first = self._last = (0, 0)
        self._last_sample: WheelSample | None = None
        self._last_us = self._started_at = 0

    def drive_at_random(self, milliseconds: int) -> None:
        """Drive at a random speed, as far as the link allows."""
        left, right = (self.random.uniform(-TOP_MPS, TOP_MPS) for _ in range(2))
        for elapsed in range(milliseconds):
            if elapsed % COMMAND_MS == 0:
                with suppress(WheelwireError):
                    self.set_velocity(left, right, TTL_S)
            self.step()

    def unplug_for(self, milliseconds: int) -> None:
        """Unplug the cable for a while, while driving."""
        self.unplug()
        self.run(milliseconds / 1e3)
        self.plug()
        self.wait_open()

    def step(self, most_us: int = STEP_US) -> None:
        """Advance one millisecond and process its samples."""
        known = len(self.samples)
        super().step(most_us)
        moment = int(self.sim.get("boot_id")), int(self.sim.get("device_us"))
        self._truth[moment] = self._true_ticks()
        while len(self._truth) > TRUTH_KEPT:
            del self._truth[next(iter(self._truth))]
        for sample in self.samples[known:]:
            self._take(sample)

    def finish(self) -> Account:
        """The results of the whole run."""
        left, _ = self._latest_sample.ticks(0.0)
        self.account.seen_ticks = left - self._started_at
        self.account.true_ticks = self._last[0] - self._first[0]
        return self.account

    def _true_ticks(self) -> tuple[int, int]:
        return int(self.sim.get("true.left_ticks")), int(self.sim.get("true.right_ticks"))

    def _take(self, sample: WheelSample) -> None:
        account, true = self.account, self._truth[(sample.boot_id, sample.t_us)]
        update = self._odometry.update(sample)
        self._latest_sample.put(remeasured(sample))
        if self._last_sample is None:
            self._first = true
            self._started_at = sample.left_ticks
        elif update.rebased:
            unseen = true[0] - self._last[0], true[1] - self._last[1]
            milliseconds = (self.now_us - self._last_us) / 1e3
            distance_m = sum(unseen) / 2 * GEOMETRY.metres_per_tick
            account.unseen.append(Unseen(milliseconds, distance_m))
            account.unseen_left += unseen[0]
            account.jumps += (update.distance_m, update.turn_rad) != (0.0, 0.0)
        zero = (
            sample.boot_id,
            tick_difference(true[0], sample.left_ticks),
            tick_difference(true[1], sample.right_ticks),
        )
        if self._zero is None or self._zero[0] != sample.boot_id:
            self._zero = zero
        account.wrong += zero != self._zero
        account.samples += 1
        self._last, self._last_sample, self._last_us = true, sample, self.now_us


def drive_and_interrupt(cycles: int, seed: int) -> EnduranceRun:
    """Drive through `cycles` interruptions, each a reset or an unplugging at random."""
    run = EnduranceRun(seed).open()
    random = run.random
    for _ in range(cycles):
        run.drive_at_random(random.randrange(50, 300))
        if random.random() < 0.5:
            run.reset()
            run.wait_open()
        else:
            run.unplug_for(random.randrange(1, 400))
    run.drive_at_random(100)
    return run


def across_the_time_wrap(seed: int) -> EnduranceRun:
    """Drive across the moment at which the 32-bit time in the state frames wraps."""
    run = EnduranceRun(seed)
    run.sim.advance_us((FIRST_WRAP_US // 1000 - 1000) * 1000)
    run.open().drive_at_random(2500)
    return run


def across_the_tick_wrap(seed: int) -> EnduranceRun:
    """Push the robot, fast and with fine encoders, until the 32-bit tick counts wrap."""
    pushed = {"left.load_nm": -0.04, "right.load_nm": -0.04}
    fine = {"counts_per_revolution": 200_000, "motor.no_load_rpm": 2000}
    run = EnduranceRun(seed, None, **pushed, **fine)
    sim = run.sim
    while sim.get("true.left_ticks") < FIRST_WRAP_TICKS - 12_000_000:
        sim.advance_us(1_000_000)
    run.open()
    run.run_until(lambda: sim.get("true.left_ticks") > FIRST_WRAP_TICKS + 1_000_000)
    return run
