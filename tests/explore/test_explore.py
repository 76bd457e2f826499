"""The explorer's cases, a few of its seeds, and its tables."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from support import exploring

pytestmark = pytest.mark.skipif(not exploring.PROGRAM.exists(), reason="not built: make cpp-tests")
SEEDS = 150
"""For each of two processes, from 1: some seconds."""


@pytest.mark.parametrize("case", sorted(exploring.CASES.glob("*.txt")), ids=lambda case: case.stem)
def test_a_case_runs_clean(case: Path) -> None:
    result = exploring.replay(case)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.whole
def test_the_first_seeds_break_no_rule() -> None:
    report = exploring.explore(1, count=SEEDS)
    assert report.broken == [], [file.read_text("utf-8") for file in report.files]


def test_a_seed_gives_the_same_run_again() -> None:
    first, again = (exploring.explore(7, count=3, processes=1) for _ in range(2))
    assert first.cells == again.cells
    assert first.totals["robot seconds"] == again.totals["robot seconds"]


def test_a_scenario_is_text_that_reads_back(tmp_path: Path) -> None:
    printed = subprocess.run(
        [exploring.PROGRAM, "--print", "5"], capture_output=True, text=True, check=True
    ).stdout
    case = tmp_path / "case.txt"
    case.write_text(printed, "utf-8")
    assert exploring.replay(case).returncode == 0


@pytest.mark.parametrize("wrong", ["leap host=0", "run metres=3", "run us"])
def test_a_wrong_line_is_named(tmp_path: Path, wrong: str) -> None:
    case = tmp_path / "case.txt"
    case.write_text(f"seed 1\n{wrong}\n", "utf-8")
    result = exploring.replay(case)
    assert result.returncode == 2
    assert "line 2" in result.stderr
