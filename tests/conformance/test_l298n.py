"""The l298n driver: gpiozero's mock pins and a PWM directory, with a model robot behind them."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.gpio_chip_process import GpioChip
from wheelwire.drivers.l298n import L298NDriver
from wheelwire.robot.robot import Robot
from wheelwire.testing import Bench, DriverConformance


class GpioBench(Bench):
    def __init__(self, chip: GpioChip) -> None:
        self.chip = chip

    def open(self) -> Robot:
        # A busy test machine must not cause a fault.
        return L298NDriver(
            parameters={"overrun_limit_us": 1e6, "brake_time_s": 0.2, "stall_time_s": 2.0},
            pwm_directory=self.chip.pwm_directory,
            core_timeout_ms=5000,
        )

    def true_ticks(self) -> tuple[int, int]:
        left, right = self.chip.truth()["ticks"]
        return left, right

    def is_driven(self) -> bool:
        return bool(self.chip.truth()["driven"])

    def lose_link(self) -> None:
        self.chip.command("pwm_away")

    def restore_link(self) -> None:
        self.chip.command("pwm_back")

    def block_left_encoder(self) -> None:
        self.chip.command("dead_left_encoder")


class TestL298n(DriverConformance):
    @pytest.fixture
    def bench(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
        with GpioChip(tmp_path) as chip:
            for name, value in chip.environment.items():
                monkeypatch.setenv(name, value)
            yield GpioBench(chip)
