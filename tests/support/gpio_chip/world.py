"""The robot behind the chip, in real time."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from support.bare_robot import EDGE, LEVELS, BareRobot, clock_us
from support.gpio_chip.chip import Chip
from support.gpio_chip.factory import EVENT
from support.gpio_chip.pwm_directory import PwmDirectory
from wheelwire.board import BoardDescription
from wheelwire.linux_mcu.gpio.base import PWM_CHANNEL, encoder_pins

BATCH_S = 0.001
CYCLE = 4
_CHANNEL = np.array([LEVELS[i - 1][0] == LEVELS[i][0] for i in range(CYCLE)], int)
_LEVEL = np.array([LEVELS[i][_CHANNEL[i]] for i in range(CYCLE)])
"""For the edge into interval i: the channel that changes, and its new level."""


class World:
    """Moves the robot as the pins say and reports its encoders' edges."""

    def __init__(self, path: Path, pwm: PwmDirectory | None, board: BoardDescription) -> None:
        self.pwm = pwm
        self.robot = BareRobot(board)
        self.spin_tps: float | None = None
        """Ticks a second at which the wheels turn, whatever the motors do."""
        self._encoders = np.array([encoder_pins(wheel) for wheel in (board.left, board.right)])
        self._spun = 0
        self._spun_to_us = clock_us()
        self.chip = Chip(path, self.apply_pins)

    @property
    def true_ticks(self) -> tuple[int, int]:
        left, right = self.robot.ticks
        return left + self._spun, right + self._spun

    def apply_pins(self) -> None:
        self.robot.set_pins(self._duty, self.chip.writer)

    def run(self) -> None:
        """Run forever, one batch per millisecond."""
        while True:
            time.sleep(BATCH_S)
            if self.pwm:
                self.pwm.export()
                self.apply_pins()
            if self.spin_tps is not None:
                self._spin(self.spin_tps, clock_us())
                continue
            edges = self.robot.advance()
            for gpio, level in zip(edges["gpio"], edges["level"], strict=True):
                self.chip.lines[gpio].level = float(level)
            if edges.size:
                self.chip.send(edges.tobytes())

    def _spin(self, ticks_per_s: float, now_us: int) -> None:
        """Whole cycles, so that runs join without a gap."""
        elapsed_us = now_us - self._spun_to_us
        due = int(elapsed_us * ticks_per_s / 1e6) // CYCLE * CYCLE
        if ticks_per_s == 0 or due == 0:
            self._spun_to_us = now_us if ticks_per_s == 0 else self._spun_to_us
            return
        ticks = np.repeat(np.arange(1, due + 1), 2)
        made = np.zeros(ticks.size, EDGE)
        made["t_ns"] = ((self._spun_to_us + ticks / ticks_per_s * 1e6) * 1e3).astype(np.int64)
        channel, right = _CHANNEL[ticks % CYCLE], np.arange(ticks.size) % 2
        made["gpio"] = self._encoders[right, channel]
        made["level"] = _LEVEL[ticks % CYCLE]
        data = memoryview(made.tobytes())
        while data:
            self.chip.send(bytes(data[: EVENT.size * 64]))
            data = data[EVENT.size * 64 :]
        self._spun += due
        self._spun_to_us += round(due / ticks_per_s * 1e6)

    def _duty(self, gpio: int) -> float:
        if self.pwm and gpio in PWM_CHANNEL:
            return self.pwm.duty(gpio)
        return self.chip.lines[gpio].level
