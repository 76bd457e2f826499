"""Drivers under the node that no other test has there, as serial and mock."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Imu

from support.gpio_chip_process import GpioChip
from support.i2c_bus import I2cBuses
from support.pi_robot import IMU, POWER, board_with
from support.pigpio_process import PigpioProcess
from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import SPEED_MPS, stands, twist
from wheelwire.tools.files.board import to_yaml

LONG_OVERRUN_LIMIT_US = 1_000_000
LONG_STALL_TIME_S = 2.0
"""A busy test machine must not cause a fault: what stands in for its motors waits, too."""


def check_driving(graph: Graph, driver: str, **options: Any) -> None:
    """There and to a halt, by odom."""
    diagnostics = Diagnostics(graph)
    odometry = graph.listen(Odometry, "odom")
    options |= {"overrun_limit_us": LONG_OVERRUN_LIMIT_US, "stall_time_s": LONG_STALL_TIME_S}
    with RobotNode(graph, driver_type=driver, **options):
        commands = graph.publisher(Twist, "cmd_vel")
        wait(lambda: odometry, "odom")
        with Repeater(commands, lambda: twist(SPEED_MPS)):
            wait(lambda: odometry[-1].pose.pose.position.x > 0.05, "5 cm")
            link = diagnostics.wait("link", lambda *_: True)
        wait(lambda: stands(odometry), "the halt")
    assert link["driver"] == driver
    assert abs(odometry[-1].pose.pose.position.y) < 0.02


def test_pigpio(graph: Graph) -> None:
    with PigpioProcess() as daemon:
        check_driving(graph, "pigpio", pigpio_host="127.0.0.1", pigpio_port=daemon.port)
        assert not daemon.command("truth")["driven"]


def test_l298n_with_its_sensors_by_the_file_of_its_board(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("gpiozero", reason="of the extra wheelwire[dev]")
    file = tmp_path / "board.yaml"
    file.write_text(to_yaml(board_with(IMU, POWER)))
    buses = I2cBuses(tmp_path / "i2c")
    with GpioChip(tmp_path, kernel_pwm=False) as chip:
        environment = chip.environment | buses.environment(chip.environment["PYTHONPATH"])
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        samples = graph.listen(Imu, "imu/data_raw")
        battery = graph.listen(BatteryState, "battery_state")
        check_driving(graph, "l298n", board=str(file))
        assert not chip.truth()["driven"]
    assert any(one.linear_acceleration.z == pytest.approx(9.8, abs=0.1) for one in samples)
    assert battery[-1].current == pytest.approx(-0.5)
