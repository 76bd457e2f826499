"""A configuration in which the interrupt of an echo would be in flash does not compile."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[3] / "firmware" / "esp32"
OPTION = "CONFIG_MCPWM_ISR_CACHE_SAFE"

pytestmark = pytest.mark.skipif(shutil.which("c++") is None, reason="needs a C++ compiler")


def preprocess(output: Path, value: int) -> subprocess.CompletedProcess[str]:
    folders = ("test/chip/idf", "main", "core", "sensors")
    return subprocess.run(
        [
            *("c++", "-std=c++20", "-E", "-o", output),
            *(f"-I{FIRMWARE / folder}" for folder in folders),
            f"-D{OPTION}={value}",
            FIRMWARE / "main" / "echo_pin.cpp",
        ],
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_option_is_in_the_defaults_and_compiles(tmp_path: Path) -> None:
    assert f"{OPTION}=y" in (FIRMWARE / "sdkconfig.defaults").read_text().splitlines()
    result = preprocess(tmp_path / "out", 1)
    assert result.returncode == 0, result.stderr


def test_without_it_the_build_says_what_to_do(tmp_path: Path) -> None:
    result = preprocess(tmp_path / "out", 0)
    assert result.returncode != 0
    assert f"{OPTION}=y" in result.stderr
    assert "delete the build folder" in result.stderr
