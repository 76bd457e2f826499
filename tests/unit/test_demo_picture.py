"""The moving picture of the first page is what the demonstration shows now."""

from __future__ import annotations

import re
from pathlib import Path

import draw_demo
from wheelwire.demo.figure import DURATION_S, commanded_path
from wheelwire.demo.scenario import STRAIGHT_S, Report
from wheelwire.motion.odometry import Pose

PICTURE = (Path(__file__).parents[2] / "docs" / "demo.svg").read_text("utf-8")
REPORT = Report(5.4, 0.0, 0.0, 1, 1, 0, 0, 0, 0.0, 0.0, 0, 0, 486_000, 0.05, None, None)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def drawn() -> str:
    """The picture of a robot that drives exactly as commanded."""
    path = commanded_path(DURATION_S + STRAIGHT_S)
    return draw_demo.draw([path, path, path], REPORT)


def test_it_is_drawn_by_the_tool_as_it_is_now() -> None:
    # Numbers are those of the run that was drawn: poses, times and what was measured.
    measured = re.compile(r'(?<=fill="#9be29b">)[^<]*')
    numbers = re.compile(rf"(?:{NUMBER.pattern}[,; ]*)+")
    now, then = (numbers.sub("#", measured.sub("", picture)) for picture in (drawn(), PICTURE))
    assert now == then


def test_the_robot_stands_at_the_end_where_nothing_plays_it() -> None:
    picture = draw_demo.draw([[Pose(0, 0, 0), Pose(1, 0, 0)]] * 3, REPORT)
    assert re.search(r'<g transform="translate\(([\d.]+),', picture)
