"""Whatever ends a recording, it reads up to the last second, and never a wrong value.

A sample: `bench/recording_crashes.py` kills more often, and ends a file at each byte.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.crashes import day, folder_in_memory, power_cuts, prefixes, short_file

pytestmark = pytest.mark.early
KILLS, CUTS = 50, 100
STEP = 3
"""Bytes between two lengths of a file."""
SEED = 20
PROGRAM = """
import dataclasses, json, sys
from support.crashes import folder_in_memory, kills
with folder_in_memory() as folder:
    for killed in kills(int(sys.argv[1]), int(sys.argv[2]), folder):
        print(json.dumps(dataclasses.asdict(killed)), flush=True)
"""


@pytest.fixture
def folder() -> Iterator[Path]:
    with folder_in_memory() as folder:
        yield folder


def test_killed_at_any_moment() -> None:
    # In a process that has no other thread, for it is forked.
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(KILLS), str(SEED)],
        capture_output=True,
        text=True,
        check=True,
        timeout=250,
        env={"PYTHONPATH": str(Path(__file__).parents[1])},
    )
    killed = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(killed) == KILLS
    assert [one for one in killed if one["problem"]] == []
    assert sum(one["recorded"] > 50 for one in killed) > KILLS / 3
    assert any(one["lost_s"] > 0 for one in killed)  # the kills do cost something


def test_a_power_cut_at_any_moment(folder: Path) -> None:
    path, moments = day(folder)
    cuts = list(power_cuts(CUTS, SEED, path, moments))
    assert [cut for cut in cuts if cut.problem] == []
    assert len(cuts) > CUTS
    assert len({cut.recorded for cut in cuts}) > 5
    assert len({synced for _, synced in moments}) > 4  # each second, at least


def test_a_file_that_ends_anywhere(folder: Path) -> None:
    lengths = list(prefixes(short_file(folder), STEP))
    assert [one for one in lengths if one.problem] == []
    assert len(lengths) > 1500
