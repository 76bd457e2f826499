"""The robot behind the pins, in real time."""

from __future__ import annotations

import threading
import time

from support.bare_robot import BareRobot, clock_us
from support.pigpiod.pins import PinBank
from support.pigpiod.reports import Notification, Sampler
from wheelwire.board import Configuration
from wheelwire.pi.gpio.base import encoder_pins

BATCH_S = 0.001


class World:
    """Moves the robot as the pins say and reports its encoders' levels."""

    def __init__(self, bank: PinBank, board: Configuration) -> None:
        self.robot = BareRobot(board)
        self.writer = ""
        """Who writes pins: a client, or a script inside the daemon."""
        self._bank = bank
        encoders = (*encoder_pins(board.left), *encoder_pins(board.right))
        self._encoder_bits = sum(1 << gpio for gpio in encoders)
        self._notifications: list[Notification] = []
        self._sampler = Sampler(bank.levels)
        self._lock = threading.Lock()

    def attach(self, notification: Notification) -> None:
        with self._lock:
            self._notifications.append(notification)

    def detach(self, notification: Notification) -> None:
        with self._lock:
            self._notifications.remove(notification)

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
        samples = self._sampler.sample(self.robot.advance())
        encoders = self._encoder_bits
        self._bank.levels = self._bank.levels & ~encoders | self._sampler.levels & encoders
        with self._lock:
            for notification in self._notifications:
                if notification.bits and samples.size:
                    notification.add(samples, now_us)
                notification.flush(now_us)
