from __future__ import annotations

import math
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from support.cases import each
from wheelwire_ros import parameters, publishers


@each(
    ("prefix", "enabled", "base"),
    [
        ("", True, "base_link"),
        ("left", True, "left/base_link"),
        ("/left/", True, "left/base_link"),
        ("left", False, "base_link"),
    ],
)
def test_a_prefix_is_parted_from_the_frame_by_one_slash(
    prefix: str, enabled: bool, base: str
) -> None:
    values: dict[str, Any] = {
        "tf_frame_prefix": prefix,
        "tf_frame_prefix_enable": enabled,
        "base_frame_id": "base_link",
    }
    assert publishers.frame("base_frame_id", values.__getitem__) == base


def test_a_wheels_turns_per_minute_are_radians_per_second() -> None:
    values = {"max_rpm": 150.0}
    tuning = parameters.tuning(lambda name: values.get(name, 0.1))
    assert tuning.max_wheel_radps == pytest.approx(5 * math.pi)


@pytest.mark.parametrize(("rearm_gap_s", "ttl_max_s", "gap_s"), [(0.5, 1.0, 1.0), (2.0, 1.0, 2.0)])
def test_the_pause_that_ends_a_hold_is_the_longer_of_the_robots_two(
    rearm_gap_s: float, ttl_max_s: float, gap_s: float
) -> None:
    values = {"rearm_gap_s": rearm_gap_s, "ttl_max_s": ttl_max_s}
    assert parameters.tuning(lambda name: values.get(name, 0.1)).rearm_gap_s == gap_s
