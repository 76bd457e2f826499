"""Pins that would not work do not compile, and the compiler says why."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

MAIN = Path(__file__).parents[3] / "firmware" / "esp32" / "main"
PINS = [
    *(f"{side}_{pin}" for side in ("LEFT", "RIGHT") for pin in ("ENABLE", "IN1", "IN2", "A", "B")),
    "ESTOP",
    "BATTERY",
    "STATUS_LED",
]
PULL_UPS = "CONFIG_WHEELWIRE_ENCODER_PULL_UPS_FITTED"
COMPILER = shutil.which("c++")

pytestmark = pytest.mark.skipif(COMPILER is None, reason="needs a C++ compiler")


def compile_board(
    folder: Path, pins: Mapping[str, int], chip: str = "ESP32", *, pull_ups: bool = False
) -> subprocess.CompletedProcess[str]:
    """Compile the board's header with these pins; the others are the board's own."""
    options = {f"CONFIG_WHEELWIRE_PIN_{pin}": pins.get(pin, -1) for pin in PINS}
    options[f"CONFIG_IDF_TARGET_{chip}"] = 1
    if pull_ups:
        options[PULL_UPS] = 1
    lines = (f"#define {name} {value}" for name, value in options.items())
    (folder / "sdkconfig.h").write_text("\n".join(lines) + "\n")
    source = folder / "board.cpp"
    source.write_text('#include "board/board.hpp"\n')
    return subprocess.run(
        [
            "c++",
            "-std=c++20",
            "-fsyntax-only",
            "-Wall",
            "-Werror",
            f"-I{folder}",
            f"-I{MAIN}",
            source,
        ],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("chip", ["ESP32", "ESP32S3", "ESP32C6"])
def test_a_boards_own_pins_compile(tmp_path: Path, chip: str) -> None:
    result = compile_board(tmp_path, {}, chip)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("pin", ["LEFT_A", "LEFT_B", "RIGHT_A", "RIGHT_B"])
@pytest.mark.parametrize("gpio", [35, 39])
def test_an_encoder_without_pull_ups_is_refused(tmp_path: Path, pin: str, gpio: int) -> None:
    refused = compile_board(tmp_path, {pin: gpio})
    assert refused.returncode != 0
    side, channel = pin.split("_")
    assert f"{side.lower()} {channel}: the pin has no pull-up" in refused.stderr
    assert PULL_UPS in refused.stderr
    fitted = compile_board(tmp_path, {pin: gpio}, pull_ups=True)
    assert fitted.returncode == 0, fitted.stderr


@pytest.mark.parametrize(
    ("pins", "reason"),
    [
        ({"LEFT_A": 6}, "left A: choose a free pin"),
        ({"LEFT_ENABLE": 34}, "left EN: choose a pin that can drive"),
        ({"ESTOP": 35}, "e-stop: choose a pin with a pull-up"),
        ({"BATTERY": 21}, "battery: choose a pin of ADC1"),
        ({"LEFT_A": 19}, "a pin is used twice"),
    ],
)
def test_what_the_chip_cannot_do_is_refused(
    tmp_path: Path, pins: dict[str, int], reason: str
) -> None:
    result = compile_board(tmp_path, pins, pull_ups=True)
    assert result.returncode != 0
    assert reason in result.stderr
