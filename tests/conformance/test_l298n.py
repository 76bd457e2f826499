"""The l298n driver: gpiozero's mock pins and a PWM directory, with a model robot behind them."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from gpiozero import Device

from support.gpio_robot import GpioRobot
from wheelwire.drivers.base import BaseDriver
from wheelwire.drivers.l298n import L298NDriver
from wheelwire.testing import Bench, DriverConformance


class GpioBench(Bench):
    def __init__(self, robot: GpioRobot, pwm_directory: Path) -> None:
        self.robot = robot
        self.pwm_directory = pwm_directory

    def open(self) -> BaseDriver:
        # A busy test machine is no fault of the robot's.
        return L298NDriver(parameters={"overrun_limit_us": 1e6}, pwm_directory=self.pwm_directory)

    def true_ticks(self) -> tuple[int, int]:
        return self.robot.robot.true_ticks

    def is_driven(self) -> bool:
        return self.robot.is_driven()

    def lose_link(self) -> None:
        assert self.robot.pwm
        self.robot.pwm.remove()

    def restore_link(self) -> None:
        assert self.robot.pwm
        self.robot.pwm.restore()

    def block_left_encoder(self) -> None:
        self.robot.robot.left.encoder.dead = True


class TestL298n(DriverConformance):
    @pytest.fixture
    def bench(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
        with GpioRobot(tmp_path / "pwm") as robot:
            monkeypatch.setattr(Device, "pin_factory", robot.factory)
            yield GpioBench(robot, tmp_path / "pwm")
