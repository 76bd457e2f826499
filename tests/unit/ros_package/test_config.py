"""The node's parameter file, against the library's file of the same robot, and what is declared."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from wheelwire import Pins, load_config
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

CONFIG = Path(__file__).parents[3] / "ros_node" / "config" / "pi4b_params.yaml"


@pytest.fixture(scope="module")
def parameters() -> dict[str, Any]:
    content = yaml.safe_load(CONFIG.read_text())
    assert list(content) == ["/**"]
    assert list(content["/**"]) == ["ros__parameters"]
    return dict(content["/**"]["ros__parameters"])


def test_the_robot_is_the_librarys(parameters: dict[str, Any]) -> None:
    robots = {name: value for name, value in parameters.items() if name in PARAMETER_BY_NAME}
    assert robots == load_config().parameters


def test_the_robot_is_the_guides(parameters: dict[str, Any]) -> None:
    assert parameters["wheel_separation"] == 0.20
    assert parameters["wheel_radius"] == 0.033
    assert parameters["counts_per_revolution"] == 360
    assert parameters["max_velocity_mps"] == 0.4
    assert parameters["pwm_frequency_hz"] == 20_000
    no_load_mps = 200 * 2 * math.pi / 60 * parameters["wheel_radius"]
    friction = PARAMETER_BY_NAME["static_feedforward"].default
    full_duty = friction + parameters["velocity_feedforward"] * no_load_mps
    assert full_duty == pytest.approx(1, abs=1e-3)


def test_each_is_declared_with_this_type(parameters: dict[str, Any]) -> None:
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros import hardware_robot
    from wheelwire_ros import parameters as node

    settings = {s.name: s.default for s in (*node.SETTINGS, *hardware_robot.SETTINGS)}
    for name, value in parameters.items():
        if name in node.ROBOT_PARAMETERS:
            assert node.from_robot(name, value).value == value
            assert type(value) is type(node.from_robot(name, value).value), name
        else:
            assert type(value) is type(settings[name]), name


def test_the_pins_are_the_librarys() -> None:
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros.hardware_robot import PINS

    assert Pins(**{n: p for n, p in PINS.items() if p >= 0}) == load_config().pins
