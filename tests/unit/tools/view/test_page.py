"""The screens of docs/view.md are what the view shows."""

import sys
from pathlib import Path

import pytest

from support.processes import captured

pytest.importorskip("textual")


def test_the_page_has_the_screens_of_today() -> None:
    tool = Path(__file__).parents[4] / "tools" / "write_view.py"
    result = captured(sys.executable, tool, "--check")
    assert result.returncode == 0, result.stderr
