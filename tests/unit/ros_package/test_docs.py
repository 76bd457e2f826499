"""The pages about ROS 2 against what they tell of."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.launch_stand_in import arguments, load

ROOT = Path(__file__).parents[3]
PAGE = "\n".join(page.read_text() for page in sorted((ROOT / "docs").glob("ros*.md")))
LAUNCH = ROOT / "ros_node" / "launch" / "hardware_bringup.launch.py"


def section(title: str) -> str:
    _, found, rest = PAGE.partition(f"## {title}\n")
    assert found
    return re.split(r"^##+ ", rest, maxsplit=1, flags=re.MULTILINE)[0]


def first_cells(text: str) -> Iterator[str]:
    """The code in the first column of all tables."""
    for line in text.splitlines():
        if line.startswith("| `"):
            yield from re.findall(r"`([^`]+)`", line.split("|")[1])


def snippets(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def test_every_launch_argument() -> None:
    assert list(first_cells(section("Start"))) == list(arguments(load(LAUNCH)))


def test_every_parameter_and_other_name() -> None:
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros import parameters
    from wheelwire_ros.parameter_values import ALIASES

    settings = {setting.name for setting in parameters.SETTINGS}
    own = section("Parameters")
    of_controller = set(first_cells(section("In place of diff_drive_controller")))
    assert set(first_cells(own)) | of_controller == settings | {"wheel_separation", "wheel_radius"}
    aliases = re.findall(r"`([\w.]+)`\s+\(`([\w.]+)`\)", own)
    assert dict(aliases) == ALIASES


def test_every_parameter_of_diff_drive_controller() -> None:
    """Those of Jazzy, by diff_drive_controller_parameter.yaml, and Humble's wheels_per_side."""
    limits = {
        f"{bound}_{quantity}"
        for quantity in ("velocity", "acceleration", "jerk")
        for bound in ("max", "min")
    } | {f"has_{quantity}_limits" for quantity in ("velocity", "acceleration", "jerk")}
    limits |= {"max_deceleration", "max_acceleration_reverse", "max_deceleration_reverse"}
    names = {f"{axis}.{limit}" for axis in ("linear.x", "angular.z") for limit in limits}
    names |= {
        "left_wheel_names",
        "right_wheel_names",
        "wheels_per_side",
        "wheel_separation",
        "wheel_radius",
        "wheel_separation_multiplier",
        "left_wheel_radius_multiplier",
        "right_wheel_radius_multiplier",
        "tf_frame_prefix_enable",
        "tf_frame_prefix",
        "odom_frame_id",
        "base_frame_id",
        "open_loop",
        "pose_covariance_diagonal",
        "twist_covariance_diagonal",
        "position_feedback",
        "enable_odom_tf",
        "cmd_vel_timeout",
        "publish_limited_velocity",
        "velocity_rolling_window_size",
        "publish_rate",
    }
    table = section("In place of diff_drive_controller")
    assert set(first_cells(table)) == names
    verdicts = [row.split("|")[2].strip() for row in table.splitlines() if row.startswith("| `")]
    assert set(verdicts) == {"same", "differs", "not here"}


def test_the_python_compiles() -> None:
    for snippet in snippets("python"):
        compile(snippet, "docs/ros*.md", "exec")
