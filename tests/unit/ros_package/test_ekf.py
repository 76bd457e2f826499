"""The filter's example against what the node publishes."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from wheelwire_protocol.sensors import IMUS, SensorChip
from wheelwire_ros.parameters import SETTINGS

PACKAGE = Path(__file__).parents[3] / "ros_node"
NODE = {setting.name: setting.default for setting in SETTINGS}
STATES = 15
VX, VY, VYAW = 6, 7, 11
"""Indices among position, attitude, their rates and the accelerations."""
IN_TWIST = {VX: 0, VY: 1, VYAW: 5}
"""Their places in twist_covariance_diagonal."""


@pytest.fixture(scope="module")
def ekf() -> dict[str, Any]:
    content = yaml.safe_load((PACKAGE / "config" / "ekf.yaml").read_text())
    assert list(content) == ["ekf_filter_node"]
    return dict(content["ekf_filter_node"]["ros__parameters"])


def test_frames_are_the_nodes(ekf: dict[str, Any]) -> None:
    assert ekf["odom_frame"] == ekf["world_frame"] == NODE["odom_frame_id"]
    assert ekf["base_link_frame"] == NODE["base_frame_id"]
    model = ET.parse(PACKAGE / "urdf" / "pi4b.urdf").getroot()  # noqa: S314 - our own file
    assert model.find(f"link[@name='{ekf['base_link_frame']}']") is not None


def test_the_wheels_give_velocities_with_a_variance(ekf: dict[str, Any]) -> None:
    assert ekf["odom0"] == "odom"
    fused = _fused(ekf["odom0_config"])
    assert fused == {VX, VY, VYAW}
    variances = NODE["twist_covariance_diagonal"]
    assert isinstance(variances, list)
    assert all(float(variances[IN_TWIST[state]]) > 0 for state in fused)


def test_the_imu_gives_the_yaw_rate(ekf: dict[str, Any]) -> None:
    assert ekf["imu0"] == "imu/data_raw"
    assert _fused(ekf["imu0_config"]) == {VYAW}


def test_the_wheels_turn_counts_only_without_the_imu() -> None:
    variances = NODE["twist_covariance_diagonal"]
    assert isinstance(variances, list)
    table = IMUS[SensorChip.MPU6050]
    gyro = (table.gyro_noise * table.gyro_radps) ** 2
    assert float(variances[IN_TWIST[VYAW]]) / gyro == pytest.approx(30_000, rel=0.1)


def test_one_of_them_publishes_the_transform(ekf: dict[str, Any]) -> None:
    assert ekf["publish_tf"] is True
    text = (PACKAGE / "config" / "ekf.yaml").read_text()
    assert "enable_odom_tf: false" in text
    assert "enable_odom_tf" in NODE


def test_it_is_as_fast_as_odometry(ekf: dict[str, Any]) -> None:
    assert ekf["frequency"] == NODE["publish_rate"]
    assert ekf["two_d_mode"] is True


def _fused(config: list[bool]) -> set[int]:
    assert len(config) == STATES
    return {index for index, fused in enumerate(config) if fused}
