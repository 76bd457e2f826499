"""A configuration in which the dead-man's interrupt would be in flash does not compile."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[3] / "firmware" / "esp32"
OPTIONS = ("CONFIG_GPTIMER_ISR_CACHE_SAFE", "CONFIG_GPTIMER_CTRL_FUNC_IN_IRAM")
# What the preprocessor need not see of ESP-IDF.
EMPTY = ("driver/gptimer.h", "esp_attr.h", "esp_private/gptimer.h", "freertos/FreeRTOS.h")

pytestmark = pytest.mark.skipif(shutil.which("c++") is None, reason="needs a C++ compiler")


def preprocess(folder: Path, options: list[str]) -> subprocess.CompletedProcess[str]:
    for name in EMPTY:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.touch()
    includes = (folder, FIRMWARE / "test" / "chip" / "idf", FIRMWARE / "main", FIRMWARE / "core")
    return subprocess.run(
        [
            *("c++", "-std=c++20", "-E", "-o", folder / "out"),
            *(f"-I{path}" for path in includes),
            *(f"-D{option}={int(option in options)}" for option in OPTIONS),
            FIRMWARE / "main" / "dead_man.cpp",
        ],
        capture_output=True,
        text=True,
        check=False,
    )


def test_both_options_are_in_the_defaults_and_compile(tmp_path: Path) -> None:
    defaults = (FIRMWARE / "sdkconfig.defaults").read_text().splitlines()
    assert {f"{option}=y" for option in OPTIONS} <= set(defaults)
    result = preprocess(tmp_path, list(OPTIONS))
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("missing", OPTIONS)
def test_a_missing_option_is_refused_with_what_to_do(tmp_path: Path, missing: str) -> None:
    result = preprocess(tmp_path, [option for option in OPTIONS if option != missing])
    assert result.returncode != 0
    assert f"{missing}=y" in result.stderr
    assert "delete the build folder" in result.stderr
