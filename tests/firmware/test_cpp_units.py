"""The C++ unit tests, of core, chip and simulator, plain and under the sanitizers."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.early
BUILD = Path(__file__).parents[2] / "build"
BUILDS = ["host", pytest.param("asan", marks=pytest.mark.whole)]


def run(build: str, program: str) -> subprocess.CompletedProcess[str]:
    path = BUILD / build / program
    if not path.exists():
        pytest.skip("not built: make cpp-tests sanitized")
    result = subprocess.run([path], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return result


@pytest.mark.parametrize(
    "program", ["wheelwire-core-test", "wheelwire-chip-test", "wheelwire-sim-test"]
)
@pytest.mark.parametrize("build", BUILDS)
def test_all_cases_pass(build: str, program: str) -> None:
    assert " cases, 0 failed checks" in run(build, program).stdout


@pytest.mark.parametrize("build", BUILDS)
def test_the_library_serves_a_program_in_c(build: str) -> None:
    assert run(build, "wheelwire-capi-test").stdout == "0 failed checks\n"


def test_the_counter_register_is_exact() -> None:
    """The default run; `wheelwire-counter-endurance 1e9` is the full one."""
    run("host", "wheelwire-counter-endurance")
