"""The firmware's fuzz targets, on every known case; `make test-all` fuzzes, too."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from support import fuzzing

BUILDS = ["host", pytest.param("asan", marks=pytest.mark.whole)]


@pytest.mark.parametrize("target", fuzzing.TARGETS)
@pytest.mark.parametrize("build", BUILDS)
def test_no_seed_and_no_case_fails(build: str, target: str) -> None:
    program = fuzzing.ROOT / "build" / build / f"wheelwire-fuzz-{target}"
    if not program.exists():
        pytest.skip("not built: make cpp-tests sanitized")
    inputs = sorted(fuzzing.seed(target).iterdir())
    result = subprocess.run([program, *inputs], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr[-4000:]
    assert result.stderr.count("Running: ") == len(inputs)


def test_a_case_is_hexadecimal_with_comments(tmp_path: Path) -> None:
    case = tmp_path / "case.hex"
    case.write_text("# all\n01 02 # two\n\n  ff0a\n", "utf-8")
    assert fuzzing.read_case(case) == b"\x01\x02\xff\x0a"
