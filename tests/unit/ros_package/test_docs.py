"""docs/ros.md against what it tells of."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.launch_stand_in import arguments, load

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
