"""Dead reckoning across a reset of the device while it drives: how far from the truth it is."""

from __future__ import annotations

import random
from contextlib import suppress

import numpy as np
import pytest

from wheelwire import LinkLost, RequestTimeout, Twist
from wheelwire.drivers.mock import MockDriver
from wheelwire.motion.covariance import PoseCovariance
from wheelwire.motion.odometry import Odometry
from wheelwire.simulation.libfwsim import FwSim

RUNS = 40
CHI_SQUARED_99 = 11.34
"""For three degrees of freedom: a hundredth of all errors are larger."""
WHEEL_VARIANCE = 2.5e-5


class Run:
    """A drive at a constant twist, a reset at a random moment, and the roll to a halt."""

    def __init__(self, seed: int) -> None:
        chance = random.Random(seed)
        self.twist = Twist(chance.uniform(0.1, 0.4), chance.uniform(-2, 2))
        with MockDriver(realtime=False) as robot:
            self._robot = robot
            self._odometry = Odometry(robot.geometry)
            self._covariance = PoseCovariance(WHEEL_VARIANCE, WHEEL_VARIANCE)
            for _ in range(chance.randrange(30, 60)):
                robot.set_velocity(*self.twist, ttl=0.5)
                self._advance(0.02)
            sigma_before = self._sigma_m()
            robot.advance(chance.uniform(0, 0.02))
            assert isinstance(robot.simulator, FwSim)
            robot.simulator.reset()
            for _ in range(40):
                self._advance(0.05)
            assert self._odometry.rebases == 1
            self.growth_m = self._sigma_m() - sigma_before
            self.error = self._error(robot.simulator)
        covariance = self._covariance.matrix
        self.normalised_error = float(self.error @ np.linalg.solve(covariance, self.error))

    def _advance(self, seconds: float) -> None:
        self._robot.advance(seconds)
        with suppress(LinkLost, RequestTimeout):  # none while the device starts
            update = self._odometry.update(self._robot.read(0))
            self._covariance.update(update, self._robot.geometry.wheel_separation)

    def _sigma_m(self) -> float:
        """Standard deviation of the position, both axes together."""
        return float(np.sqrt(np.trace(self._covariance.matrix[:2, :2])))

    def _error(self, simulator: FwSim) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        pose = self._odometry.pose
        truth = [simulator.get(f"true.{name}") for name in ("x_m", "y_m", "heading_rad")]
        return np.array(truth) - [pose.x_m, pose.y_m, pose.heading_rad]


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return [Run(seed) for seed in range(RUNS)]


def test_an_unseen_drive_is_within_the_covariance(runs: list[Run]) -> None:
    assert max(run.normalised_error for run in runs) < CHI_SQUARED_99


def test_it_is_no_larger_than_it_has_to_be(runs: list[Run]) -> None:
    """Three degrees of freedom have a mean of 3, were the errors normal."""
    mean = float(np.mean([run.normalised_error for run in runs]))
    assert mean > 1
    for run in runs:
        unseen_m = float(np.hypot(*run.error[:2]))
        assert unseen_m / 3 < run.growth_m < 5 * unseen_m
