"""A configuration or an ESP-IDF with which an interrupt would fail does not compile."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from support.processes import captured

FIRMWARE = Path(__file__).parents[3] / "firmware" / "esp32"
# What the preprocessor need not see of ESP-IDF.
EMPTY = ("driver/gptimer.h", "esp_attr.h", "esp_private/gptimer.h", "freertos/FreeRTOS.h")
FOLDERS = ("test/chip/idf", "main", "core", "sensors")


class Refusal(NamedTuple):
    """Some definitions that a source refuses.

    Attributes:
        source: In the folder main.
        good: Definitions with which it compiles.
        bad: Those that it refuses.
        says: What the compiler prints.
    """

    source: str
    good: Mapping[str, int]
    bad: Mapping[str, int]
    says: str


def version(major: int, minor: int, patch: int) -> dict[str, int]:
    return {"ESP_IDF_VERSION": major << 16 | minor << 8 | patch}


DEAD_MAN = {"CONFIG_GPTIMER_ISR_CACHE_SAFE": 1, "CONFIG_GPTIMER_CTRL_FUNC_IN_IRAM": 1}
ECHO = {"CONFIG_MCPWM_ISR_CACHE_SAFE": 1}
REFUSALS = [
    *(Refusal("dead_man", DEAD_MAN, {option: 0}, f"{option}=y") for option in DEAD_MAN),
    *(Refusal("echo_pin", ECHO, {option: 0}, f"{option}=y") for option in ECHO),
    *(
        Refusal("panic", version(5, 5, 3), version(*older), "ESP-IDF 5.5.3 or later")
        for older in ((5, 4, 1), (5, 4, 2), (5, 5, 2))
    ),
]


def preprocess(
    folder: Path, source: str, definitions: Mapping[str, int]
) -> subprocess.CompletedProcess[str]:
    for name in EMPTY if source == "dead_man" else ():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.touch()
    return captured(
        *("c++", "-std=c++20", "-E", "-o", folder / "out"),
        *(f"-I{path}" for path in (folder, *(FIRMWARE / name for name in FOLDERS))),
        *(f"-D{name}={value}" for name, value in definitions.items()),
        FIRMWARE / "main" / f"{source}.cpp",
    )


@pytest.mark.skipif(shutil.which("c++") is None, reason="needs a C++ compiler")
@pytest.mark.parametrize("refusal", REFUSALS, ids=lambda refusal: f"{refusal.bad}")
def test_what_would_fail_is_refused_with_what_to_do(tmp_path: Path, refusal: Refusal) -> None:
    sound = preprocess(tmp_path, refusal.source, refusal.good)
    assert sound.returncode == 0, sound.stderr
    result = preprocess(tmp_path, refusal.source, {**refusal.good, **refusal.bad})
    assert result.returncode != 0
    assert refusal.says in result.stderr
    assert "delete the build folder" in result.stderr


def test_the_options_are_in_the_defaults() -> None:
    defaults = (FIRMWARE / "sdkconfig.defaults").read_text().splitlines()
    assert {f"{option}=y" for option in (*DEAD_MAN, *ECHO)} <= set(defaults)
