"""Where a robot believes to be after 30 s with slip, by its wheels and with a gyroscope.

In virtual time and seeded: docs/ros-nav2.md. The filter is of robot_localization's kind, with its
process noise; it fuses what config/ekf.yaml names, with the covariances that stand in the messages.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from wheelwire import (
    DifferentialDrive,
    ImuSample,
    Odometry,
    WheelSample,
    WheelVelocities,
    open_driver,
)
from wheelwire.drivers.mock import VirtualMockDriver

Vector: TypeAlias = npt.NDArray[np.float64]
SECONDS = 30.0
STEP_S = 0.02
REST_S = 2.0
"""Before the drive: the wheels stand, and the gyroscope's bias is measured."""
SPEED_MPS = 0.25
SEEDS = range(5)
RADIUS_M = 1.0
"""Radius of the figure eight."""
VX_VARIANCE = 1e-3
YAW_RATE_VARIANCE = 1e-2
"""Variances of odom: the node's twist_covariance_diagonal."""
PROCESS_NOISE = np.diag([0.05, 0.05, 0.06, 0.025, 0.02])
"""robot_localization's defaults for x, y, yaw, v and w, per second."""
V, W = 3, 4
BIAS_RADPS = 0.01
"""Bias of the gyroscope: 0.6 degrees a second."""
WAYS = (
    "wheels alone",
    "wheels + gyro, bias taken at rest",
    "the same, and the wheels' yaw rate",
    "wheels + gyro, bias left in",
)

CONDITIONS: dict[str, dict[str, float]] = {
    "no slip": {},
    "the left wheel on ice, 10 s of the 30": {"left.slip": 0.3},
    "both wheels on ice, 10 s of the 30": {"left.slip": 0.3, "right.slip": 0.3},
}
ICE_S = (10.0, 20.0)


class Measured(NamedTuple):
    """A velocity that a sensor measured."""

    stamp: float
    which: int
    value: float
    variance: float


class Filter:
    """An extended Kalman filter over x, y, yaw, v and w: constant velocities with process noise."""

    def __init__(self) -> None:
        self.state: Vector = np.zeros(5)
        self._covariance: Vector = np.eye(5) * 1e-9
        self._stamp: float | None = None

    def update(self, measured: Measured) -> None:
        """Predict up to the measurement, and correct by it."""
        if self._stamp is not None:
            self._predict(measured.stamp - self._stamp)
        self._stamp = measured.stamp
        covariance = self._covariance
        gain = covariance[:, measured.which] / (
            covariance[measured.which, measured.which] + measured.variance
        )
        self.state = self.state + gain * (measured.value - self.state[measured.which])
        self._covariance = covariance - np.outer(gain, covariance[measured.which])

    def _predict(self, step_s: float) -> None:
        x, y, yaw, v, w = self.state
        cos, sin = math.cos(yaw), math.sin(yaw)
        jacobian = np.eye(5)
        jacobian[0, 2], jacobian[0, V] = -v * sin * step_s, cos * step_s
        jacobian[1, 2], jacobian[1, V] = v * cos * step_s, sin * step_s
        jacobian[2, W] = step_s
        self.state = np.array([x + v * cos * step_s, y + v * sin * step_s, yaw + w * step_s, v, w])
        self._covariance = jacobian @ self._covariance @ jacobian.T + PROCESS_NOISE * step_s


class Drive(NamedTuple):
    """What was measured on a drive, and where the robot was at its end."""

    wheels: list[WheelSample]
    gyro: list[ImuSample]
    rest: list[ImuSample]
    gyro_variance: float
    geometry: DifferentialDrive
    truth: tuple[float, float, float]
    """x, y and heading."""


def driven(settings: dict[str, float], seed: int, bias_radps: float) -> Drive:
    """Drive a figure eight; `settings` hold in the middle third."""
    with open_driver("mock", realtime=False) as robot:
        assert isinstance(robot, VirtualMockDriver)
        sim = robot.simulator
        sim.set("imu.bias", bias_radps)
        robot.sensors.start(100)
        robot.advance(0.2 + 0.1 * seed)  # another beginning: other noise
        wheels, imu = robot.samples(), robot.imu.samples()
        rest: list[ImuSample] = []
        for _ in range(round(REST_S / STEP_S)):
            robot.advance(STEP_S)
            rest += iter(imu.poll, None)
        seen: list[WheelSample] = list(iter(wheels.poll, None))[-1:]
        gyro: list[ImuSample] = []
        for step in range(round(SECONDS / STEP_S)):
            now_s = step * STEP_S
            on_ice = ICE_S[0] <= now_s < ICE_S[1]
            for name, value in settings.items():
                sim.set(name, value if on_ice else 0.0)
            turn = 1 if now_s < SECONDS / 2 else -1
            robot.set_velocity(SPEED_MPS, turn * SPEED_MPS / RADIUS_M)
            robot.advance(STEP_S)
            seen += iter(wheels.poll, None)
            gyro += iter(imu.poll, None)
        info = robot.imu.info
        assert info is not None
        truth = sim.get("true.x_m"), sim.get("true.y_m"), sim.get("true.heading_rad")
        return Drive(seen, gyro, rest, info.gyro_noise**2, robot.geometry, truth)


def wheels_alone(drive: Drive) -> tuple[float, float, float]:
    """The node's odometry: x, y and heading."""
    odometry = Odometry(drive.geometry)
    for sample in drive.wheels:
        odometry.update(sample)
    pose = odometry.pose
    return pose.x_m, pose.y_m, pose.heading_rad


def filtered(drive: Drive, *, bias_radps: float, fuses_wheels_turn: bool) -> list[float]:
    """The filter's state at the end."""
    measured = [
        Measured(one.stamp, W, one.gyro[2] - bias_radps, drive.gyro_variance) for one in drive.gyro
    ]
    for sample in drive.wheels:
        twist = drive.geometry.twist(WheelVelocities(sample.left_mps, sample.right_mps))
        measured.append(Measured(sample.stamp, V, twist.linear_mps, VX_VARIANCE))
        if fuses_wheels_turn:
            measured.append(Measured(sample.stamp, W, twist.angular_radps, YAW_RATE_VARIANCE))
    filter_ = Filter()
    for one in sorted(measured):
        filter_.update(one)
    return [float(number) for number in filter_.state]


def error_m(drive: Drive, pose: Sequence[float]) -> float:
    """How far a pose is from the true one."""
    return math.hypot(pose[0] - drive.truth[0], pose[1] - drive.truth[1])


def main() -> None:
    """Print the table."""
    rows = []
    for name, settings in CONDITIONS.items():
        errors: dict[str, list[float]] = {way: [] for way in WAYS}
        for seed in SEEDS:
            drive = driven(settings, seed, BIAS_RADPS)
            at_rest = fmean(sample.gyro[2] for sample in drive.rest)
            ends: tuple[Sequence[float], ...] = (
                wheels_alone(drive),
                filtered(drive, bias_radps=at_rest, fuses_wheels_turn=False),
                filtered(drive, bias_radps=at_rest, fuses_wheels_turn=True),
                filtered(drive, bias_radps=0.0, fuses_wheels_turn=False),
            )
            for way, end in zip(WAYS, ends, strict=True):
                errors[way].append(error_m(drive, end))
        rows.append([name, *(f"{fmean(found):.3f} m" for found in errors.values())])
    sys.stdout.write(table(("error at the end", *WAYS), rows))


if __name__ == "__main__":
    main()
