"""The robot behind the pins, in real time."""

from __future__ import annotations

import threading
import time

from support.bare_robot import BareRobot, clock_us
from support.pigpiod.pins import PinBank
from support.pigpiod.reports import Notification, Sampler
from support.pigpiod.spinner import Spinner
from wheelwire.board import BoardDescription
from wheelwire.linux_mcu.gpio.base import encoder_pins

BATCH_S = 0.001


class World:
    """Moves the robot as the pins say and reports its encoders' levels.

    Attributes:
        spinner: Turns the wheels in place of the motors, once it is set.
    """

    def __init__(self, bank: PinBank, counts_per_revolution: int, board: BoardDescription) -> None:
        self.robot = BareRobot(board, counts_per_revolution)
        self.spinner: Spinner | None = None
        self.writer = ""
        """Who writes pins: a client, or a script inside the daemon."""
        self._bank = bank
        self._board = board
        encoders = (*encoder_pins(board.left), *encoder_pins(board.right))
        self._encoder_bits = sum(1 << gpio for gpio in encoders)
        self._notifications: list[Notification] = []
        self._sampler = Sampler(bank.levels)
        self._now_us = clock_us()
        self._lock = threading.Lock()

    def spin(self, ticks_per_s: float) -> None:
        """Turn both wheels at this rate from now on, whatever the motors do."""
        self.spinner = self.spinner or Spinner(self._board)
        self.spinner.ticks_per_s = ticks_per_s

    @property
    def true_ticks(self) -> tuple[int, int]:
        left, right = self.robot.ticks
        spun = self.spinner.ticks if self.spinner else 0
        return left + spun, right + spun

    def attach(self, notification: Notification) -> None:
        with self._lock:
            self._notifications.append(notification)

    def detach(self, notification: Notification) -> None:
        with self._lock:
            self._notifications.remove(notification)

    @property
    def driven(self) -> bool:
        self.apply_pins()
        return self.robot.driven

    def apply_pins(self) -> None:
        """Apply the outputs' levels to the stages as soon as they change."""
        self.robot.set_pins(self._bank.enable, self.writer)

    def run(self) -> None:
        """Run forever, one batch per millisecond."""
        while True:
            time.sleep(BATCH_S)
            self._batch(clock_us())

    def _batch(self, now_us: int) -> None:
        self.apply_pins()
        if self.spinner is None:
            samples = self._sampler.sample(self.robot.advance())
            levels = self._sampler.levels
        else:
            samples = self.spinner.samples(self._now_us, now_us)
            levels = int(samples["levels"][-1]) if samples.size else self._bank.levels
        self._now_us = now_us
        encoders = self._encoder_bits
        self._bank.levels = self._bank.levels & ~encoders | levels & encoders
        with self._lock:
            for notification in self._notifications:
                if notification.bits and samples.size:
                    notification.add(samples, now_us)
                notification.flush(now_us)
