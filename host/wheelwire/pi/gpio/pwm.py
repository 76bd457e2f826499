"""PWM on a bridge's EN: the kernel's if available, else the pin library's."""

from __future__ import annotations

import os
import time
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...errors import DriverUnavailable, LinkLost
from .base import PWM_CHANNEL

CHANNELS_BY_COUNT = {2: PWM_CHANNEL, 4: {12: 0, 13: 1, 18: 2, 19: 3}}
"""The channel of a GPIO: on a Pi 1 to 4, whose chip has 2 channels, and on a Pi 5, with 4."""
EXPORT_TIMEOUT_S = 2.0
"""udev sets the permissions of a new channel shortly after it appears."""
SOFTWARE_PWM_HZ = 1000
"""For PWM timed by a thread: a late edge changes the duty, the less so the longer the period."""


class EnablePwm(ABC):
    """The PWM of one EN input."""

    @abstractmethod
    def set(self, duty: float) -> None:
        """Set the duty, 0..1; 0 is low. Raises `LinkLost`."""

    @abstractmethod
    def close(self) -> None:
        """Set EN low and release it. Raises nothing."""


class KernelPwm(EnablePwm):
    """PWM by a channel of the kernel, under /sys/class/pwm.

    Args:
        chip: Directory of its chip.
        number: Its number on the chip.
    """

    def __init__(self, chip: Path, number: int) -> None:
        self._chip = chip
        self._number = number
        self._directory = chip / f"pwm{number}"
        self._period_ns = 0

    def open(self, frequency_hz: float) -> None:
        """Export the channel, low.

        Raises:
            DriverUnavailable: It cannot be opened.
        """
        self._period_ns = round(1e9 / frequency_hz)
        try:
            # A channel stays exported, so an earlier run may have left this one.
            if not self._directory.exists():
                _write(self._chip / "export", self._number)
                self._wait_until_writable()
            # The kernel refuses a period below the duty, and a channel that was exported before
            # still has its last duty: so the duty goes first. But it refuses any duty of a channel
            # without a period, as a newly exported one is.
            if int((self._directory / "period").read_text("utf-8")):
                _write(self._directory / "duty_cycle", 0)
            _write(self._directory / "period", self._period_ns)
            # Last: from here on the channel puts out its duty, which is 0.
            _write(self._directory / "enable", 1)
        except OSError as error:
            raise DriverUnavailable(
                f"{self._directory}: {error.strerror}: add the user to the group gpio, and end any "
                "other program that uses this PWM channel"
            ) from error

    def set(self, duty: float) -> None:
        """Set the duty. Written even if unchanged: a channel that is lost must be noticed."""
        try:
            _write(self._directory / "duty_cycle", round(duty * self._period_ns))
        except OSError as error:
            raise LinkLost(f"{self._directory}: {error.strerror}") from error

    def close(self) -> None:
        """Set the channel low; it stays exported. Whether it was opened does not matter."""
        # The duty first: which level a disabled channel has depends on the kernel's driver.
        for name in ("duty_cycle", "enable"):
            with suppress(OSError):
                _write(self._directory / name, 0)

    def _wait_until_writable(self) -> None:
        end = time.monotonic() + EXPORT_TIMEOUT_S
        while not os.access(self._directory / "enable", os.W_OK) and time.monotonic() < end:
            time.sleep(0.01)


class LibraryPwm(EnablePwm):
    """PWM by the pin factory, in a thread or a daemon.

    Raises:
        DriverUnavailable: The pin factory has no PWM.
    """

    def __init__(self, pin: Any, frequency_hz: float) -> None:
        self._pin = pin
        self.frequency_hz = min(frequency_hz, SOFTWARE_PWM_HZ)
        # Low before the PWM begins.
        pin.output_with_state(0)
        try:
            pin.frequency = self.frequency_hz
        except AttributeError as error:  # PinPWMUnsupported is one
            raise DriverUnavailable(
                f"{pin!r}: this pin factory has no PWM; add dtoverlay=pwm-2chan to config.txt, or "
                "install lgpio"
            ) from error
        pin.state = 0

    def set(self, duty: float) -> None:
        """Set the duty. The factory rounds it; lgpio's has 100 steps."""
        self._pin.state = duty

    def close(self) -> None:
        """Make the pin an input: the bridge's pull-down then holds EN low."""
        with suppress(Exception):  # each factory has its own errors
            self._pin.close()


def find_channels(
    directory: Path, number: int | None, gpios: tuple[int, ...]
) -> list[KernelPwm] | None:
    """The kernel's PWM channels of `gpios`; None unless each of them has one of its own.

    Args:
        directory: Directory of the kernel's PWM chips.
        number: Number of the chip, or None for the only one.
        gpios: BCM numbers.

    Raises:
        DriverUnavailable: There are several chips, or `number` does not exist.
    """
    chips = {}
    for chip in sorted(directory.glob("pwmchip*")):
        # A chip with another number of channels does not lead to the header.
        channels = CHANNELS_BY_COUNT.get(int((chip / "npwm").read_text("utf-8")))
        if channels:
            chips[chip.name] = (chip, channels)
    name = f"pwmchip{number}" if number is not None else next(iter(chips), None)
    if number is None and len(chips) > 1:
        raise DriverUnavailable(f"several PWM chips ({_names(chips)}): choose one with pwm_chip")
    if name is None:
        return None
    if name not in chips:
        raise DriverUnavailable(
            f"no {name} with GPIO channels in {directory} (there: {_names(chips)}): set pwm_chip"
        )
    chip, channels = chips[name]
    numbers = [channels[gpio] for gpio in gpios if gpio in channels]
    if len(set(numbers)) < len(gpios):  # two GPIOs of one channel carry the same signal
        return None
    return [KernelPwm(chip, number) for number in numbers]


def _names(chips: dict[str, Any]) -> str:
    return ", ".join(chips) or "none"


def _write(file: Path, value: int) -> None:
    # Without Python's buffers: sysfs takes a value in one write, and each step writes several.
    descriptor = os.open(file, os.O_WRONLY | os.O_TRUNC)
    try:
        os.write(descriptor, f"{value}\n".encode())
    finally:
        os.close(descriptor)
