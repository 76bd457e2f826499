"""The gyroscope's bias is what it measures at rest, and nothing else."""

from __future__ import annotations

import math
from random import Random

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from support.host_samples import sample
from support.sensor_messages import Stream, info
from wheelwire import ImuSample
from wheelwire_ros.gyro_bias import GyroBias

NOISE_RADPS = 0.001
NOISE_MPS2 = 0.03
BIAS = (0.01, -0.02, 0.03)


class Robot:
    """Its samples at 100 Hz."""

    def __init__(self, noise_radps: float = NOISE_RADPS) -> None:
        self.bias = GyroBias(noise_radps, NOISE_MPS2)
        self._random = Random(1)
        self._stamp = 0.0
        self._ticks = 0

    def be_silent(self, seconds: float) -> None:
        """Its IMU sends nothing."""
        self._stamp += seconds

    def run(
        self,
        seconds: float,
        yaw_rate_radps: float = 0.0,
        *,
        wheels_turn: bool = False,
        shake_mps2: float = 0.0,
        up_mps2: float = 9.8,
    ) -> None:
        for _ in range(round(seconds * 100)):
            self._stamp += 0.01
            self._ticks += wheels_turn
            self.bias.note_wheels(sample(left_ticks=self._ticks))
            x, y, z = (one + self._random.gauss(0, NOISE_RADPS) for one in BIAS)
            gyro = x, y, z + yaw_rate_radps
            shake = shake_mps2 * math.sin(self._stamp * 30)
            pull = self._random.gauss(shake, NOISE_MPS2), 0.0, up_mps2
            imu = ImuSample(0, 0, gyro, pull, 20.0, self._stamp, 0.001)
            self.corrected = self.bias.corrected(imu)


def test_a_second_of_rest_tells_the_bias() -> None:
    robot = Robot()
    robot.run(0.9)
    assert robot.bias.radps == (0, 0, 0)
    robot.run(0.3)
    assert robot.bias.radps == pytest.approx(BIAS, abs=NOISE_RADPS / 2)
    assert robot.corrected == pytest.approx((0, 0, 0), abs=5 * NOISE_RADPS)
    robot.run(1.0, 0.5, wheels_turn=True)
    assert robot.bias.radps == pytest.approx(BIAS, abs=NOISE_RADPS / 2)
    assert robot.corrected[2] == pytest.approx(0.5, abs=5 * NOISE_RADPS)


def test_the_bias_in_the_boards_file_is_not_taken_off_twice() -> None:
    at_rest = Stream()  # 2, 4 and 6 counts; y points forward
    of_board = info(0, values=(1, 2, 3))._replace(gyro_scale=0.015, accelerometer_scale=9.81 / 42.5)
    at_rest.stream.take_info(of_board)
    bias = GyroBias(NOISE_RADPS, 1.0)
    for k in range(102):
        at_rest.imu(3_000_000 + 10_000 * k)
        bias.note_wheels(sample())
        _, imu = at_rest.sensed[-1]
        assert isinstance(imu, ImuSample)
        corrected = bias.corrected(imu)
    # What the file's has left, which would be none if that were taken off here again.
    assert bias.radps == pytest.approx((0.03, -0.015, 0.045))
    assert corrected == pytest.approx((0, 0, 0))


def test_a_robot_that_drives_is_not_at_rest() -> None:
    robot = Robot()
    robot.run(5.0, 0.02, wheels_turn=True)  # slower than what only a turning robot does
    assert robot.bias.radps == (0, 0, 0)


def test_a_steady_turn_of_the_floor_is_no_bias() -> None:
    robot = Robot()
    robot.run(5.0, 1.0)
    assert robot.bias.radps == (0, 0, 0)


def test_a_second_with_a_gap_tells_no_bias() -> None:
    robot = Robot()
    for _ in range(20):
        robot.run(0.1)
        robot.be_silent(0.9)
    assert robot.bias.radps == (0, 0, 0)
    robot.run(1.1)
    assert robot.bias.radps == pytest.approx(BIAS, abs=NOISE_RADPS / 2)


def test_a_steady_turn_on_a_turntable_is_not_bias() -> None:
    robot = Robot()
    robot.run(2.0)
    robot.run(6.0, 1.6 / 6)
    assert robot.bias.radps == pytest.approx(BIAS, abs=NOISE_RADPS / 2)
    assert robot.bias.turning_radps == pytest.approx(1.6 / 6 + BIAS[2], abs=NOISE_RADPS)
    robot.run(2.0)
    assert robot.bias.turning_radps == 0


@pytest.mark.parametrize("moved", [{"shake_mps2": 1.0}, {"up_mps2": 12.0}])
def test_the_accelerometer_has_to_agree(moved: dict[str, float]) -> None:
    """In a car, or in a lift that starts, the wheels stand, and the gyroscope is calm."""
    robot = Robot()
    robot.run(3.0, 0.02, **moved)  # type: ignore[arg-type]
    assert robot.bias.radps == (0, 0, 0)
