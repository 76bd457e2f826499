"""docs/ros.md against what it tells of."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from support.launch_stand_in import arguments, load
from wheelwire import load_config

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "ros.md").read_text()
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
    from wheelwire_ros import hardware_robot, parameters

    settings = {s.name for s in (*parameters.SETTINGS, *hardware_robot.SETTINGS)}
    assert set(first_cells(section("Parameters"))) == settings
    aliases = re.findall(r"`([\w.]+)`\s+\(`([\w.]+)`\)", section("Parameters"))
    assert dict(aliases) == parameters.ALIASES


def test_the_python_compiles() -> None:
    for snippet in snippets("python"):
        compile(snippet, "docs/ros.md", "exec")


def test_nav2_stays_within_the_robots_limits() -> None:
    limit = load_config().parameters["max_velocity_mps"]
    (nav2,) = [c for c in map(yaml.safe_load, snippets("yaml")) if "velocity_smoother" in c]
    follow = nav2["controller_server"]["ros__parameters"]["FollowPath"]
    smoother = nav2["velocity_smoother"]["ros__parameters"]
    assert follow["vx_max"] == smoother["max_velocity"][0] <= limit
    assert follow["vx_min"] == smoother["min_velocity"][0] >= -limit
    assert follow["wz_max"] == smoother["max_velocity"][2] == -smoother["min_velocity"][2]


def test_all_of_nav2_sends_the_same_type() -> None:
    (nav2,) = [c for c in map(yaml.safe_load, snippets("yaml")) if "velocity_smoother" in c]
    senders = {
        "controller_server",
        "behavior_server",
        "velocity_smoother",
        "collision_monitor",
        "docking_server",
    }
    stamped = {name for name in nav2 if _stamped(nav2[name])}
    assert stamped == senders


def _stamped(node: dict[str, Any]) -> bool:
    parameters = node.get("ros__parameters", {})
    return parameters.get("enable_stamped_cmd_vel") is True


def test_links_within_the_page_and_the_repository() -> None:
    anchors = {
        re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
        for title in re.findall(r"^##+ (.*)$", PAGE, re.MULTILINE)
    }
    for target in re.findall(r"\]\(([^)]+)\)", PAGE):
        if target.startswith("#"):
            assert target[1:] in anchors
        elif not target.startswith("https://"):
            assert (ROOT / "docs" / target.partition("#")[0]).exists(), target
