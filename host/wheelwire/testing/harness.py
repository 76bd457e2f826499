"""A driver and the robot behind it, as the conformance tests use them; times are of its samples."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal, TypeVar

import pytest

from ..errors import LinkLost, RequestTimeout
from ..robot.robot import Robot
from ..samples import WheelSample


class Bench(ABC):
    """A robot that the tests may drive at up to 0.4 m/s, each way and turning on the spot.

    Only `open` is mandatory. A test that needs one of the other methods is skipped if the bench
    does not have it.
    """

    @abstractmethod
    def open(self) -> Robot:
        """Open the driver under test; the tests shut it down."""

    def pass_time(self, seconds: float) -> None:
        """Let the robot's time pass without calling the driver."""
        time.sleep(seconds)

    def true_ticks(self) -> tuple[int, int]:
        """The ticks (left, right) that perfect encoders would have counted."""
        pytest.skip("this bench cannot count the true ticks")

    def is_driven(self) -> bool:
        """Whether a motor is driven; braking is not driving."""
        pytest.skip("this bench does not see the bridge")

    def lose_link(self) -> None:
        """Cut the link between the driver and the robot."""
        pytest.skip("this bench cannot cut the link")

    def restore_link(self) -> None:  # noqa: B027 - called after lose_link only
        """Restore the link."""

    def block_left_encoder(self) -> None:
        """Make the left encoder stop counting."""
        pytest.skip("this bench cannot break an encoder")


REPEAT_S = 0.05
TTL_S = 0.5
TIMEOUT_S = 30.0
"""In the robot's time. Much longer than anything takes: a busy machine must not fail a test."""

SPEED_MPS = 0.2
"""The default speed of the tests."""
CLOSE = 0.1
"""Relative tolerance."""
ATTEMPTS = 10
"""For measurements that another program can spoil by taking the processor for a while."""

Result = TypeVar("Result")
Condition = Callable[[WheelSample], bool]


class DriveHarness:
    """A driver and the samples read from it. Time comes from the samples; nothing here sleeps."""

    def __init__(self, driver: Robot) -> None:
        self.driver = driver
        self.samples: list[WheelSample] = []

    def next(self) -> WheelSample:
        """Read the next sample."""
        sample = self.driver.read(TIMEOUT_S)
        self.samples.append(sample)
        return sample

    def watch(self, seconds: float) -> list[WheelSample]:
        """Read the samples of the next `seconds` without sending a command."""
        first = self.next()
        watched = [first]
        while watched[-1].t_us - first.t_us < seconds * 1e6:
            watched.append(self.next())
        return watched

    def wait(self, condition: Condition) -> WheelSample:
        """Wait for a sample that fulfils `condition`, without sending a command."""
        return self._until(condition, lambda: None)

    def drive(self, linear: float, angular: float, seconds: float) -> list[WheelSample]:
        """Command a body velocity for `seconds`; returns the samples."""
        start = self.next()
        before = len(self.samples)
        self.drive_until(linear, angular, lambda s: s.t_us - start.t_us >= seconds * 1e6)
        return self.samples[before:]

    def drive_until(self, linear: float, angular: float, condition: Condition) -> WheelSample:
        """Command a body velocity until a sample fulfils `condition`."""
        return self._until(condition, lambda: self.driver.set_velocity(linear, angular, ttl=TTL_S))

    def drive_duty(self, left: float, right: float, condition: Condition) -> WheelSample:
        """Command a duty until a sample fulfils `condition`."""
        return self._until(condition, lambda: self.driver.set_duty(left, right, ttl=TTL_S))

    def steady(
        self, linear: float, angular: float, expected: Callable[[list[WheelSample]], bool]
    ) -> list[WheelSample]:
        """Drive at a constant velocity until one second of samples is as `expected`.

        It tries again, because this program or the robot's may have been delayed for a while.
        """
        # The first second is for getting up to speed.
        self.drive(linear, angular, 1.0)
        return self.first(lambda: self.drive(linear, angular, 1.0), expected)

    def time_to(
        self, begin: Callable[[], object], condition: Condition, limit_s: float
    ) -> WheelSample:
        """Call `begin` and wait for `condition`, which must come within `limit_s` of its return.

        It tries again if the condition was late, because this program may have been delayed.
        """

        def attempt() -> tuple[WheelSample, float]:
            before = self.next().command_seq
            begin()
            # The clock of the driver's stamps, which may be a virtual one.
            begun_s = self.driver._now_us() / 1e6
            # A sample from before `begin` may still be waiting; it has the previous number.
            sample = self.wait(lambda s: s.command_seq != before and condition(s))
            return sample, sample.stamp - begun_s

        return self.first(attempt, lambda result: result[1] < limit_s)[0]

    def rest(self) -> WheelSample:
        """Stop, and wait until the wheels are at rest."""
        self.driver.stop()
        return self.wait(standing)

    def recovers(self) -> bool:
        """Whether the driver reads a sample in time, though its link may have been lost."""
        try:
            self.next()
        except (LinkLost, RequestTimeout):
            return False
        return True

    @staticmethod
    def first(attempt: Callable[[], Result], good: Callable[[Result], bool]) -> Result:
        """Repeat an attempt that another program may spoil, and return the first good result."""
        results = []
        for _ in range(ATTEMPTS):
            results.append(attempt())
            if good(results[-1]):
                return results[-1]
        raise AssertionError(f"none of {ATTEMPTS} attempts was good, the last one: {results[-1]}")

    def _until(self, condition: Condition, command: Callable[[], None]) -> WheelSample:
        command()
        sample = self.next()
        start_us = commanded_us = sample.t_us
        while not condition(sample):
            assert sample.t_us - start_us < TIMEOUT_S * 1e6, (
                f"the condition was never fulfilled, last sample: {sample}"
            )
            if sample.t_us - commanded_us >= REPEAT_S * 1e6:
                command()
                commanded_us = sample.t_us
            sample = self.next()
        return sample


def turning(sample: WheelSample) -> bool:
    """Whether both wheels are near SPEED_MPS or faster."""
    return min(sample.left_mps, sample.right_mps) > 0.8 * SPEED_MPS


def standing(sample: WheelSample) -> bool:
    """Whether both measured velocities are zero."""
    return sample.left_mps == 0 and sample.right_mps == 0


def mean_of(samples: list[WheelSample], side: Literal["left", "right"]) -> float:
    """The arithmetic mean of a wheel's velocity, in m/s."""
    left = side == "left"
    return sum(s.left_mps if left else s.right_mps for s in samples) / len(samples)
