"""The screens of docs/view.md are what the view shows."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("textual")


def test_the_page_has_the_screens_of_today() -> None:
    tool = Path(__file__).parents[4] / "tools" / "write_view.py"
    result = subprocess.run(
        [sys.executable, tool, "--check"], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
