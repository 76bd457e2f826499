"""The README's picture of the demonstration is drawn by tools/draw_demo.py, from a run."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

from wheelwire.demo.report import Report

ROOT = Path(__file__).parents[2]
REPORT = Report(0.0, 0.0, 0.0, 0, 0, 0, 0, 0, 0.0, 0.0, 0, 0, 0, 0.0, "", None)


def test_it_says_what_the_demonstration_prints() -> None:
    picture = (ROOT / "docs" / "demo.svg").read_text("utf-8")
    labels = {unescape(text) for text in re.findall("<text[^>]*>([^<]*)", picture)}
    assert {label for label, _ in REPORT.rows() if label != "picture"} <= labels
