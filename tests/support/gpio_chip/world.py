"""The model robot behind the chip, in real time."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np

from support.gpio_chip.chip import Chip
from support.gpio_chip.factory import EVENT
from support.gpio_chip.pwm_directory import PwmDirectory
from support.plant.bridge import Wiring
from support.plant.encoder import LEVELS, Edge
from support.plant.motor import MotorModel
from support.plant.robot import ModelRobot
from wheelwire.files.pins import Pins
from wheelwire.linux_mcu.encoder import A
from wheelwire.linux_mcu.gpio.base import PWM_CHANNEL, encoder_pins

BATCH_S = 0.001
CATCH_UP_US = 100_000
"""After a longer gap, such as a stopped process, the robot's time continues from now."""
CYCLE = 4
EVENTS = np.dtype([("t_ns", "<u8"), ("gpio", "<u4"), ("level", "<u4")])
_CHANNEL = np.array([LEVELS[i - 1][0] == LEVELS[i][0] for i in range(CYCLE)], int)
_LEVEL = np.array([LEVELS[i][_CHANNEL[i]] for i in range(CYCLE)])
"""For the edge into interval i: the channel that changes, and its new level."""


class World:
    """Moves the robot as the pins say and reports its encoders' edges."""

    def __init__(self, path: Path, pwm: PwmDirectory | None, wiring: Wiring) -> None:
        self.pwm = pwm
        self.wiring = wiring
        self.pins = Pins()
        self.robot = ModelRobot(MotorModel(), 360, clock_us())
        self.driven = False
        self.driven_changed_us = 0
        """When a motor was last switched on or off."""
        self.changes: list[tuple[int, bool, bool, int]] = []
        """Time, whether a motor is driven, whether one is braked, and the process that wrote a pin
        last. The kernel's PWM has no process."""
        self.spin_tps: float | None = None
        """Ticks a second at which the wheels turn, whatever the motors do."""
        self._spun = 0
        self._spun_to_us = clock_us()
        self._lock = threading.Lock()
        self.chip = Chip(path, self.apply_pins)

    @property
    def true_ticks(self) -> tuple[int, int]:
        left, right = self.robot.true_ticks
        return left + self._spun, right + self._spun

    def apply_pins(self) -> None:
        with self._lock:
            self.wiring.apply(self._duty, self.robot.wheels)
            driven = any(wheel.driven for wheel in self.robot.wheels)
            if driven != self.driven:
                self.driven, self.driven_changed_us = driven, clock_us()
            braked = any(wheel.enable > 0 and not wheel.driven for wheel in self.robot.wheels)
            if not self.changes or self.changes[-1][1:3] != (driven, braked):
                self.changes.append((clock_us(), driven, braked, self.chip.writer))

    def run(self) -> None:
        """Run forever, one batch per millisecond."""
        while True:
            time.sleep(BATCH_S)
            if self.pwm:
                self.pwm.export()
                self.apply_pins()
            now_us = clock_us()
            if self.spin_tps is not None:
                self._spin(self.spin_tps, now_us)
                continue
            edges: list[bytes] = []

            def collect(side: int, edge: Edge, t_us: float, edges: list[bytes] = edges) -> None:
                gpio = self._gpio(side, edge.channel == A)
                self.chip.lines[gpio].level = edge.level
                edges.append(EVENT.pack(int(t_us * 1000), gpio, edge.level))

            self.robot.advance_to(now_us, collect, CATCH_UP_US)
            if edges:
                self.chip.send(b"".join(edges))

    def _spin(self, ticks_per_s: float, now_us: int) -> None:
        """Whole cycles, so that runs join without a gap."""
        elapsed_us = now_us - self._spun_to_us
        due = int(elapsed_us * ticks_per_s / 1e6) // CYCLE * CYCLE
        if ticks_per_s == 0 or due == 0:
            self._spun_to_us = now_us if ticks_per_s == 0 else self._spun_to_us
            return
        ticks = np.repeat(np.arange(1, due + 1), 2)
        made = np.zeros(ticks.size, EVENTS)
        made["t_ns"] = ((self._spun_to_us + ticks / ticks_per_s * 1e6) * 1e3).astype(np.int64)
        channel, right = _CHANNEL[ticks % CYCLE], np.arange(ticks.size) % 2
        gpios = np.array([[self._gpio(side, a) for a in (True, False)] for side in (0, 1)])
        made["gpio"] = gpios[right, channel]
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

    def _gpio(self, side: int, a: bool) -> int:
        gpio_a, gpio_b = encoder_pins((self.pins.left, self.pins.right)[side])
        return gpio_a if a else gpio_b


def clock_us() -> int:
    return time.monotonic_ns() // 1000
