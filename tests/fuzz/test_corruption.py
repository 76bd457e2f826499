"""Damaged frames: the targets are met in a small run. docs/reliability.md has the large one."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

PROGRAM = Path(__file__).parents[2] / "build" / "host" / "wheelwire-corruption"
INJECTIONS = 1_000_000
KINDS = ["bit flips", "bursts", "losses", "repeats", "insertions", "overwrites"]


@pytest.mark.whole
@pytest.mark.skipif(not PROGRAM.exists(), reason="not built: make cpp-tests")
def test_no_wrong_message_and_no_untouched_frame_lost() -> None:
    command = [str(PROGRAM), "--bits", "2", "--random", str(INJECTIONS)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    rows = re.findall(
        r"(.*?) +(\d+) injected +(\d+) refused by CRC .* 0 wrong +0 lost\n", result.stdout
    )
    assert [name for name, _, _ in rows] == KINDS
    assert all(int(injected) >= INJECTIONS / 5 for _, injected, _ in rows)
    assert all(int(refused) > 0 for _, _, refused in rows)  # the CRC was put to the test
