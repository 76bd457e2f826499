"""The robot behind the chip, in real time."""

from __future__ import annotations

import time
from pathlib import Path

from support.bare_robot import BareRobot
from support.gpio_chip.chip import EVENT, Chip
from support.gpio_chip.pwm_directory import PwmDirectory
from wheelwire.board import Configuration
from wheelwire.pi.gpio.base import PWM_CHANNEL, encoder_pins

BATCH_S = 0.001
PART = 64 * EVENT.size
"""What a listener takes in one piece."""


class World:
    """Moves the robot as the pins say and reports its encoders' edges."""

    def __init__(self, path: Path, pwm: PwmDirectory | None, board: Configuration) -> None:
        self.pwm = pwm
        self.robot = BareRobot(board)
        self._encoders = (*encoder_pins(board.left), *encoder_pins(board.right))
        self.chip = Chip(path, self.apply_pins)

    def apply_pins(self) -> None:
        self.robot.set_pins(self._duty, self.chip.writer)

    def run(self) -> None:
        """Run forever, one batch per millisecond."""
        while True:
            time.sleep(BATCH_S)
            if self.pwm:
                self.pwm.export()
                self.apply_pins()
            edges = self.robot.advance()
            if not edges.size:
                continue
            for gpio in self._encoders:
                levels = edges["level"][edges["gpio"] == gpio]
                if levels.size:
                    self.chip.lines[gpio].level = float(levels[-1])
            data = edges.tobytes()
            for begin in range(0, len(data), PART):
                self.chip.send(data[begin : begin + PART])

    def _duty(self, gpio: int) -> float:
        if self.pwm and gpio in PWM_CHANNEL:
            return self.pwm.duty(gpio)
        return self.chip.lines[gpio].level
