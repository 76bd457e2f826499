"""A Raspberry Pi's pins with a model robot behind them: gpiozero's mock pins and a PWM directory.

The directory is written as the kernel's is, but by files: what it refuses, they take.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

from gpiozero.pins.mock import MockFactory, MockPWMPin

from wheelwire.local.pins import PWM_CHANNEL, Pins
from wheelwire.local.quadrature import A
from wheelwire.plant.encoder import Edge
from wheelwire.plant.motor import MotorModel
from wheelwire.plant.robot import ModelRobot

BATCH_S = 0.001


class WiredPin(MockPWMPin):  # type: ignore[misc]
    """Its level is the wire's, whatever the pull."""

    def _set_pull(self, value: str) -> None:
        self._pull = value

    def wire(self, level: int) -> None:
        """What is connected drives it."""
        if self.function == "input":
            (self.drive_high if level else self.drive_low)()


class PwmDirectory:
    """/sys/class/pwm with one chip of two channels."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.chip = root / "pwmchip0"
        self._away = root / "away"
        self._duties = [0.0, 0.0]
        self.chip.mkdir(parents=True)
        (self.chip / "npwm").write_text("2\n")
        (self.chip / "export").touch()

    def export(self) -> None:
        """As the kernel, make the channel that was asked for."""
        asked = _number(self.chip / "export")
        channel = self.chip / f"pwm{asked}"
        if asked is None or channel.exists():
            return
        made = self.chip / "new"
        made.mkdir()
        for name in ("duty_cycle", "period", "enable"):
            (made / name).write_text("0\n")
        made.rename(channel)

    def duty(self, gpio: int) -> float:
        """On the pin; the last one while the chip is away."""
        index = PWM_CHANNEL[gpio]
        channel = self.chip / f"pwm{index}"
        values = [_number(channel / name) for name in ("enable", "duty_cycle", "period")]
        if None not in values:
            enable, duty, period = (int(value or 0) for value in values)
            self._duties[index] = duty / period if enable and period else 0.0
        return self._duties[index]

    def remove(self) -> None:
        self.chip.rename(self._away)

    def restore(self) -> None:
        self._away.rename(self.chip)


class GpioRobot:
    """Runs from `with` to the end of its block."""

    def __init__(self, root: Path, pins: Pins | None = None, kernel_pwm: bool = True) -> None:
        self.pins = pins or Pins()
        self.factory = MockFactory(pin_class=WiredPin)
        self.pwm = PwmDirectory(root) if kernel_pwm else None
        self.robot = ModelRobot(MotorModel(), 360, _now_us())
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="model robot")

    def __enter__(self) -> GpioRobot:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def is_driven(self) -> bool:
        self._apply()
        return any(wheel.driven for wheel in self.robot.wheels)

    def _run(self) -> None:
        while not self._end.is_set():
            if self.pwm:
                self.pwm.export()
            self._apply()
            self.robot.advance_to(_now_us(), self._wire)
            time.sleep(BATCH_S)

    def _apply(self) -> None:
        pins, robot = self.pins, self.robot
        robot.left.set_inputs(self._level(pins.left_dir1), self._level(pins.left_dir2))
        robot.right.set_inputs(self._level(pins.right_dir1), self._level(pins.right_dir2))
        robot.left.set_enable(self._enable(pins.left_pwm))
        robot.right.set_enable(self._enable(pins.right_pwm))

    def _enable(self, gpio: int) -> float:
        return self.pwm.duty(gpio) if self.pwm else float(self._pin(gpio).state)

    def _level(self, gpio: int) -> bool:
        return bool(self._pin(gpio).state)

    def _wire(self, side: int, edge: Edge, _: float) -> None:
        pins = self.pins
        a, b = (
            (pins.left_enc_a, pins.left_enc_b)
            if side == 0
            else (pins.right_enc_a, pins.right_enc_b)
        )
        self._pin(a if edge.channel == A else b).wire(edge.level)

    def _pin(self, gpio: int) -> Any:
        return self.factory.pin(gpio)


def _now_us() -> int:
    return time.monotonic_ns() // 1000


def _number(file: Path) -> int | None:
    try:
        return int(file.read_text())
    except (OSError, ValueError):  # away, or just being written
        return None
