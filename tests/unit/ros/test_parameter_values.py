from __future__ import annotations

import math
import re
from array import array
from typing import Any

import numpy as np
import pytest

from support.cases import each

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from wheelwire_ros import parameter_values as checks
from wheelwire_ros.parameters import SETTINGS

AGREEING: dict[str, Any] = {
    "odom_frame_id": "odom",
    "base_frame_id": "base_link",
    "left_wheel_names": ["left"],
    "right_wheel_names": ["right"],
    "wheels_per_side": 0,
    "cmd_vel_timeout": 0.5,
    "ttl_max_s": 0.5,
    "battery_empty_v": math.nan,
    "battery_full_v": math.nan,
}


@each(
    ("check", "value", "words"),
    [
        (checks.variances, [0.0] * 5, "it has 5 numbers: write six"),
        (checks.variances, [0.0] * 5 + [-1.0], "at least 0"),
        (checks.variances, [0.0] * 5 + [math.nan], "finite"),
        (checks.frame, "", "a frame has a name"),
        (checks.frame, "/", "a frame has a name"),
        (checks.wheel_names, [], "at least one name"),
        (checks.wheel_names, ["a", ""], "no empty one"),
        (checks.command_timeout, 0.0, "must expire: .* 0.02 to 5.0"),
        (checks.at_least_zero, -0.1, "at least 0.0, or .NAN"),
        (checks.at_least_zero, math.inf, ".NAN for no limit"),
        (checks.at_most_zero, 0.1, "at most 0.0, or .NAN"),
        (checks.above_zero, 0.0, "above 0.0, or .NAN"),
        (checks.only(False, "leave it out"), True, "leave it out"),
    ],
)
def test_an_invalid_value_is_refused_with_what_to_write(
    check: checks.Check, value: Any, words: str
) -> None:
    reason = check(value)
    assert reason is not None
    assert re.search(words, reason)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"base_frame_id": "/odom"}, "equal"),
        ({"left_wheel_names": ["a", "b"]}, "2 wheels on the left and 1 on the right"),
        ({"left_wheel_names": ["right"]}, "right: named more than once"),
        ({"ttl_max_s": 0.3}, "0.5 s is longer than the robot allows, 0.3 s"),
        ({"battery_full_v": 8.4}, "one is given without the other"),
        ({"battery_empty_v": 8.4, "battery_full_v": 6.0}, "swap them"),
        ({"wheels_per_side": 2}, "leave out wheels_per_side"),
    ],
)
def test_what_contradicts_itself_is_named(changes: dict[str, Any], words: str) -> None:
    (found,) = checks.disagreements({**AGREEING, **changes}.__getitem__)
    assert words in found.reason
    assert set(changes) <= set(found.names)


def test_values_that_agree_are_not_named() -> None:
    assert list(checks.disagreements(AGREEING.__getitem__)) == []
    two = {"left_wheel_names": ["a", "b"], "right_wheel_names": ["c", "d"], "wheels_per_side": 2}
    assert list(checks.disagreements({**AGREEING, **two}.__getitem__)) == []
    stored = {"cmd_vel_timeout": 0.3, "ttl_max_s": float(np.float32(0.3))}
    assert list(checks.disagreements({**AGREEING, **stored}.__getitem__)) == []
    assert list(checks.disagreements({**AGREEING, "ttl_max_s": None}.__getitem__)) == []


@each(
    ("a", "b", "equal"),
    [
        (0.2, 0.20000000298023224, True),  # what 32 bits leave of it
        (0.2, 0.201, False),
        (math.nan, math.nan, True),
        ([1.0, math.nan], array("d", [1.0, math.nan]), True),
        ([1.0], [1.0, 2.0], False),
        (["a"], ["a"], True),
        ("a", "b", False),
        (True, True, True),
        (None, 1.0, False),
    ],
)
def test_values_are_compared_as_the_robot_stores_them(a: Any, b: Any, equal: bool) -> None:
    assert checks.same(a, b) is equal


@each(
    ("name", "value", "words"),
    [
        *(
            (f"{axis}.{limit}", value, words)
            for axis in ("linear.x", "angular.z")
            # A limit of 0 would disable the robot.
            for limit, value, words in (
                ("max_velocity", 0.0, "above 0.0, or .NAN"),
                ("max_acceleration", 0.0, "above 0.0, or .NAN"),
                ("max_jerk", 0.0, "above 0.0, or .NAN"),
                ("max_deceleration", 0.1, "at most 0.0, or .NAN"),
            )
        ),
        ("max_rpm", 0.0, "above 0.0, or .NAN"),
        ("base_frame_id", "", "a frame has a name"),
        ("pose_covariance_diagonal", [0.0] * 5, "write six"),
        ("twist_covariance_diagonal", [-1.0] * 6, "at least 0"),
    ],
)
def test_a_parameter_has_its_check(name: str, value: Any, words: str) -> None:
    (setting,) = (one for one in SETTINGS if one.name == name)
    assert setting.check is not None
    assert words in str(setting.check(value))
    assert setting.check(setting.default) is None
