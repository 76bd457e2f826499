"""With the message packages; without rclpy."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("nav_msgs.msg", reason="`make ros` brings ROS's messages (Linux, x86-64)")

from wheelwire_ros import robot_settings


@pytest.mark.parametrize(
    ("prefix", "base"),
    [("", "base_link"), ("left", "left/base_link"), ("/left/", "left/base_link")],
)
def test_a_prefix_is_parted_from_the_frame_by_one_slash(prefix: str, base: str) -> None:
    values: dict[str, Any] = {
        "tf_frame_prefix": prefix,
        "tf_frame_prefix_enable": True,
        "odom_frame_id": "odom",
        "base_frame_id": "base_link",
    }
    assert robot_settings.frames(values.__getitem__).base == base


def test_a_prefix_can_be_switched_off() -> None:
    values: dict[str, Any] = {
        "tf_frame_prefix": "left",
        "tf_frame_prefix_enable": False,
        "odom_frame_id": "odom",
        "base_frame_id": "base_link",
    }
    assert robot_settings.frames(values.__getitem__) == ("odom", "base_link")
