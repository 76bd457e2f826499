"""A directory like /sys/class/pwm, made of plain files, which accept any value."""

from __future__ import annotations

import os
import threading
from pathlib import Path

from wheelwire.pi.gpio.base import PWM_CHANNEL


class PwmDirectory:
    """One chip with two channels. Thread-safe."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.chip = root / "pwmchip0"
        self._away = root / "away"
        self._asked = _Number(self.chip / "export")
        self._exported: set[int] = set()
        self._channels = [
            [_Number(self.chip / channel / name) for name in ("enable", "duty_cycle", "period")]
            for channel in ("pwm0", "pwm1")
        ]
        self._duties = [0.0, 0.0]
        self._lock = threading.Lock()
        self.chip.mkdir(parents=True)
        (self.chip / "npwm").write_text("2\n")
        (self.chip / "export").touch()

    def export(self) -> None:
        """Create the channel that was exported, as the kernel does."""
        asked = self._asked.read()
        if asked is None or asked in self._exported:
            return
        with self._lock:
            made = self.chip / "new"
            made.mkdir()
            for name in ("duty_cycle", "period", "enable"):
                (made / name).write_text("0\n")
            made.rename(self.chip / f"pwm{asked}")
        self._exported.add(asked)

    def duty(self, gpio: int) -> float:
        """The duty on the pin; the last one while the chip is missing."""
        index = PWM_CHANNEL[gpio]
        values = [number.read() for number in self._channels[index]]
        if None not in values:
            enable, duty, period = (int(value or 0) for value in values)
            self._duties[index] = duty / period if enable and period else 0.0
        return self._duties[index]

    def remove(self) -> None:
        with self._lock:
            self.chip.rename(self._away)

    def restore(self) -> None:
        with self._lock:
            self._away.rename(self.chip)


class _Number:
    """What a file says. It stays open, because it is read each millisecond."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._descriptor: int | None = None

    def read(self) -> int | None:
        try:
            if self._descriptor is None:
                self._descriptor = os.open(self._file, os.O_RDONLY)
            return int(os.pread(self._descriptor, 32, 0))
        except (OSError, ValueError):  # not there yet, or just being written
            return None
