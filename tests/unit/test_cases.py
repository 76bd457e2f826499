"""`support.cases.each` reports every case that fails, not only the first."""

from __future__ import annotations

import sys
from pathlib import Path

from support.processes import captured

TESTS = Path(__file__).parents[1]

PLANTED = """
import pytest
from support.cases import each

@pytest.fixture
def limit():
    return 4

@each("number, square", [(1, 1), (2, 5), (3, 9), (3, 8)])
def test_squares(limit, number, square):
    assert number < limit
    assert number**2 == square
"""


def test_a_second_planted_error_is_reported_too(tmp_path: Path) -> None:
    file = tmp_path / "test_planted.py"
    file.write_text(PLANTED)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--rootdir", str(tmp_path)]
    result = captured(*command, str(file), env={"PYTHONPATH": str(TESTS)}, cwd=tmp_path)
    failed = [line for line in result.stdout.splitlines() if line.startswith("SUBFAILED")]
    assert [line.partition("]")[0] for line in failed] == ["SUBFAILED[2, 5", "SUBFAILED[3, 8"]
    assert result.returncode == 1
