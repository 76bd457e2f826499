"""A directory like /sys/class/pwm, made of plain files, which accept any value."""

from __future__ import annotations

import threading
from pathlib import Path

from wheelwire.pi.gpio.base import PWM_CHANNEL


class PwmDirectory:
    """One chip with two channels. Thread-safe."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.chip = root / "pwmchip0"
        self._away = root / "away"
        self._duties = [0.0, 0.0]
        self._lock = threading.Lock()
        self.chip.mkdir(parents=True)
        (self.chip / "npwm").write_text("2\n")
        (self.chip / "export").touch()

    def export(self) -> None:
        """Create the channel that was exported, as the kernel does."""
        with self._lock:
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
        """The duty on the pin; the last one while the chip is missing."""
        index = PWM_CHANNEL[gpio]
        channel = self.chip / f"pwm{index}"
        values = [_number(channel / name) for name in ("enable", "duty_cycle", "period")]
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


def _number(file: Path) -> int | None:
    try:
        return int(file.read_text())
    except (OSError, ValueError):  # away, or just being written
        return None
