"""Driving in laps on a bad line; both ends' counters are compared with its ground truth."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, TypeVar

from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import LinkLost, RequestTimeout
from wheelwire.simulation.bad_line import Impairment, LineProfile
from wheelwire.simulation.impaired_simulator import ImpairedSimulator

T = TypeVar("T")
PAGE_KIB = os.sysconf("SC_PAGE_SIZE") // 1024
STATE_HZ = 1000
COMMAND_PERIOD_S = 0.02
TTL_S = 0.3
CORRUPT = 0.01
"""Probability for each byte, in both directions."""
LAP_S = 5.0
UNPLUGGED_S = 0.2
TIMEOUT_S = 60.0
SETTLED = 300
"""Readings."""
PROFILE = LineProfile(Impairment(), Impairment(), seed=11)


class Gap(NamedTuple):
    """One direction's ground truth less its receiver's counters; constant if every loss is counted.

    Attributes:
        frames: Good frames that passed, less good frames counted.
        lost: Frames lost on the way and before, less the gaps counted in sequence numbers.
    """

    frames: int
    lost: int


@dataclass(frozen=True)
class Lap:
    """The results of one lap.

    Attributes:
        incident: What ended it, after its counts were checked.
        frames: Given to the line, towards host and device.
        hit: Of these, lost or damaged.
        uncounted: Losses in the ground truth that no counter has: host's `Gap`, then device's;
            target 0.
        ticks_wrong: Of both wheels, against the plant, since the device's reset; target 0.
        recovery_s: From the port's return, or the reset, to a sample of a new session.
        expired: Setpoints refused so far, because they came later than they lived.
        sessions: Opened within the lap, which no loss should make happen; target 0.
        resident_kib: This process's memory, then the simulator's.
        threads: Of this process.
        files: Open in this process.
    """

    incident: str
    frames: int
    hit: int
    uncounted: tuple[int, ...]
    ticks_wrong: int
    recovery_s: float
    expired: int
    sessions: int
    resident_kib: tuple[int, int]
    threads: int
    files: int


class Soak:
    """A robot on a bad line, driven lap by lap."""

    def __init__(self, simulator: ImpairedSimulator, robot: SerialDriver) -> None:
        self._simulator = simulator
        self._robot = robot
        self._laps = 0
        self._tick_base = self._ticks_against_plant()

    def lap(self, seconds: float = LAP_S) -> Lap:
        """Drive on the bad line, check all counts on a good one, then a reset or an unplugging."""
        line = self._simulator.line
        before = replace(line.to_host.truth), replace(line.to_device.truth)
        opened = self._host_gap(), self._device_gap()
        sessions = self._robot.statistics.sessions
        self._corrupt(CORRUPT)
        self._drive(seconds)
        self._corrupt(0.0)
        self._stand()
        closed = self._host_gap(), self._device_gap()
        passed = list(zip((line.to_host.truth, line.to_device.truth), before, strict=True))
        sessions = self._robot.statistics.sessions - sessions
        ticks_wrong = self._ticks_against_plant() - self._tick_base
        self._laps += 1
        incident = ("unplug", "reset")[self._laps % 2]
        recovery_s = self._inject(incident)
        return Lap(
            incident=incident,
            frames=sum(later.frames - earlier.frames for later, earlier in passed),
            hit=sum(later.hit - earlier.hit for later, earlier in passed),
            uncounted=tuple(
                after - before
                for pair in zip(opened, closed, strict=True)
                for before, after in zip(*pair, strict=True)
            ),
            ticks_wrong=ticks_wrong,
            recovery_s=recovery_s,
            expired=self._robot.statistics.setpoints_expired,
            sessions=sessions,
            resident_kib=(resident_kib(os.getpid()), resident_kib(self._simulator.pid)),
            threads=len(list(Path("/proc/self/task").iterdir())),
            files=len(list(Path("/proc/self/fd").iterdir())),
        )

    # --- the lap's parts -----------------------------------------------------------------------

    def _corrupt(self, chance: float) -> None:
        line = self._simulator.line
        line.to_host.impairment.corrupt = line.to_device.impairment.corrupt = chance

    def _drive(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        turn = 0.8 if self._laps % 2 else -0.8
        while time.monotonic() < end:
            self._robot.set_velocity(0.2, turn, ttl=TTL_S)
            time.sleep(COMMAND_PERIOD_S)

    def _stand(self) -> None:
        retry(self._robot.stop)
        wait_until(lambda: self._simulator.get("stands_still") == 1, TIMEOUT_S)

    def _inject(self, incident: str) -> float:
        """Unplug and plug again, or reset, on the bad line; returns the seconds to recover."""
        self._corrupt(CORRUPT)
        self._robot.set_velocity(0.2, 0.0, ttl=TTL_S)
        sessions = self._robot.statistics.sessions
        if incident == "unplug":
            self._simulator.unplug()
            time.sleep(UNPLUGGED_S)  # the fault itself
            self._simulator.plug()
        else:
            self._simulator.reset()
        begin = time.monotonic()
        wait_until(
            lambda: self._robot.statistics.sessions > sessions and self._is_open(), TIMEOUT_S
        )
        recovery_s = time.monotonic() - begin
        self._corrupt(0.0)
        # A restarted robot obeys nothing before it; on a good line it arrives.
        self._robot.set_velocity(0.0, 0.0, ttl=TTL_S)
        self._stand()
        if incident == "reset":
            self._tick_base = self._ticks_against_plant()
        return recovery_s

    def _is_open(self) -> bool:
        try:
            self._robot.get_encoder_ticks()
        except (LinkLost, RequestTimeout):
            return False
        return True

    def _ticks_against_plant(self) -> int:
        """How many ticks the host has too many, of both wheels, while the robot is at rest."""
        started_us = self._robot.read(TIMEOUT_S).t_us
        wait_until(lambda: self._robot.read(TIMEOUT_S).t_us != started_us, TIMEOUT_S)
        measured = self._robot.get_encoder_ticks()
        true = (self._simulator.get("true.left_ticks"), self._simulator.get("true.right_ticks"))
        return sum(measured) - int(sum(true))

    # --- counts --------------------------------------------------------------------------------

    def _host_gap(self) -> Gap:
        """On a good line: the least of many readings, for frames under way make one too high."""
        truth = self._simulator.line.to_host.truth
        least, since = Gap(sys.maxsize, sys.maxsize), 0
        while since < SETTLED:
            time.sleep(0.0005)  # or this thread keeps the others from handling what is under way
            before = replace(truth)
            counted = self._robot.statistics
            if replace(truth) != before:
                continue
            frames = before.frames - before.hit - counted.frames_received
            lost = before.hit + before.missing - counted.frames_lost
            fallen = Gap(min(least.frames, frames), min(least.lost, lost))
            since = since + 1 if fallen == least else 0
            least = fallen
        return least

    def _device_gap(self) -> Gap:
        """On a good line. Only an answer to the last frame that was sent covers all of them."""
        truth = self._simulator.line.to_device.truth
        end = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end:
            before = truth.frames
            counted = retry(self._robot.device_counters)
            if truth.frames == before + 1:
                frames = truth.frames - truth.hit - counted.frames_received
                return Gap(frames, truth.hit + truth.missing - counted.seq_lost)
        raise AssertionError("the line towards the device is never quiet")


def run(minutes: float, lap_s: float = LAP_S) -> list[Lap]:
    """Drive laps for a given time."""
    laps: list[Lap] = []
    end = time.monotonic() + minutes * 60
    with (
        ImpairedSimulator(PROFILE, seed=3) as simulator,
        SerialDriver(simulator.port, stream_rate_hz=STATE_HZ, connect_timeout=TIMEOUT_S) as robot,
    ):
        soak = Soak(simulator, robot)
        while time.monotonic() < end:
            laps.append(soak.lap(lap_s))
    return laps


def retry(action: Callable[[], T]) -> T:
    """Retry until the link is up: a request whose answer is lost may be repeated."""

    def answers() -> list[T]:
        try:
            return [action()]
        except (LinkLost, RequestTimeout):
            return []

    return wait_until(answers, TIMEOUT_S)[0]


def resident_kib(pid: int) -> int:
    """A process's resident memory."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_KIB
