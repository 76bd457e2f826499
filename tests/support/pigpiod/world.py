"""The model robot behind the pins, in real time."""

from __future__ import annotations

import threading
import time

from support.pigpiod.pins import PinBank
from support.pigpiod.reports import Notification, Sampler
from support.pigpiod.spinner import Spinner
from support.plant.bridge import Wiring
from support.plant.encoder import Edge
from support.plant.motor import MotorModel
from support.plant.robot import ModelRobot
from wheelwire.files.pins import Pins
from wheelwire.linux_mcu.encoder import A, B
from wheelwire.linux_mcu.gpio.base import encoder_pins

BATCH_S = 0.001
CATCH_UP_US = 100_000
"""After a longer gap, such as a stopped process, the robot's time continues from now."""


def clock_us() -> int:
    return time.monotonic_ns() // 1000


class World:
    """Moves the robot as the pins say and reports its encoders' levels.

    Attributes:
        spinner: Turns the wheels in place of the motors, once it is set.
    """

    def __init__(self, bank: PinBank, counts_per_revolution: int, wiring: Wiring) -> None:
        self._wiring = wiring
        self.robot = ModelRobot(MotorModel(), counts_per_revolution, clock_us())
        self.spinner: Spinner | None = None
        self.driven_changed_us = 0
        """When a motor was last switched on or off."""
        self.changes: list[tuple[int, bool, str]] = []
        """Time, whether a motor is driven, and who wrote a pin last."""
        self.writer = ""
        """Who writes pins: a client, or a script inside the daemon."""
        self._bank = bank
        self._pins = Pins()
        self._notifications: list[Notification] = []
        self._sampler = Sampler(bank.levels)
        self._now_us = clock_us()
        self._lock = threading.Lock()

    def spin(self, ticks_per_s: float) -> None:
        """Turn both wheels at this rate from now on, whatever the motors do."""
        self.spinner = self.spinner or Spinner(self._pins)
        self.spinner.ticks_per_s = ticks_per_s

    @property
    def true_ticks(self) -> tuple[int, int]:
        left, right = self.robot.true_ticks
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
        return any(wheel.driven for wheel in self.robot.wheels)

    def apply_pins(self) -> None:
        """Apply the outputs' levels to the bridge as soon as they change."""
        before = any(wheel.driven for wheel in self.robot.wheels)
        self._wiring.apply(self._bank.enable, self.robot.wheels)
        if before != any(wheel.driven for wheel in self.robot.wheels):
            self.driven_changed_us = clock_us()
            self.changes.append((self.driven_changed_us, not before, self.writer))

    def run(self) -> None:
        """Run forever, one batch per millisecond."""
        while True:
            time.sleep(BATCH_S)
            self._batch(clock_us())

    def _batch(self, now_us: int) -> None:
        self.apply_pins()
        if self.spinner is None:
            samples = self._sampler.sample(self._edges(now_us))
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

    def _edges(self, now_us: int) -> list[tuple[float, int, int]]:
        edges: list[tuple[float, int, int]] = []

        def collect(side: int, edge: Edge, t_us: float) -> None:
            edges.append((t_us, self._gpio(side, edge.channel), edge.level))

        self.robot.advance_to(now_us, collect, CATCH_UP_US)
        return sorted(edges)

    @property
    def _encoder_bits(self) -> int:
        return sum(1 << self._gpio(side, channel) for side in (0, 1) for channel in (A, B))

    def _gpio(self, side: int, channel: int) -> int:
        gpio_a, gpio_b = encoder_pins((self._pins.left, self._pins.right)[side])
        return gpio_a if channel == A else gpio_b
