"""Turns both wheels at one rate, fast, with numpy."""

from __future__ import annotations

import numpy as np

from support.bare_robot import LEVELS
from support.pigpiod.reports import SAMPLE_US, Samples, make_samples
from wheelwire.board import BoardDescription
from wheelwire.linux_mcu.gpio.base import encoder_pins


class Spinner:
    """Stands in for the motors. Its first edges follow the encoders' rest at LEVELS[0]."""

    def __init__(self, board: BoardDescription) -> None:
        self.ticks_per_s = 0.0
        self.ticks = 0
        """Ticks so far, of each wheel."""
        self._position = 0.0
        (left_a, left_b), (right_a, right_b) = encoder_pins(board.left), encoder_pins(board.right)
        self._levels = np.array(
            [a << left_a | b << left_b | a << right_a | b << right_b for a, b in LEVELS]
        )

    def samples(self, start_us: int, end_us: int) -> Samples:
        """The edges in this time as a sampling every 5 us sees them."""
        before, rate = self._position, self.ticks_per_s / 1e6
        self._position += rate * (end_us - start_us)
        first, self.ticks = self.ticks, int(self._position)
        ticks = np.arange(first + 1, self.ticks + 1)
        if ticks.size == 0:
            return make_samples([], [])
        t_us = (start_us + (ticks - before) / rate).astype(np.int64) // SAMPLE_US * SAMPLE_US
        last = np.append(t_us[1:] != t_us[:-1], True)
        return make_samples(t_us[last], self._levels[ticks[last] % 4])
