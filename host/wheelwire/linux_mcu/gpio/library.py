"""Pins through gpiozero's pin factory, with the kernel's PWM if available."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ...errors import DriverUnavailable, LinkLost, WheelwireError
from ..encoder import A, B, QuadratureDecoder
from ..settings import McuSettings
from .base import Gpio, HalfBridge, PinsBusy, WheelPair
from .enable_pwm import EnablePwm, KernelPwm, LibraryPwm, find_channels

LIMITS = ("glitch_filter_ns is not applied: filter the encoder lines in hardware",)
CLAIM_TIMEOUT_S = 0.1
"""The kernel releases the lines of a killed process shortly after the process has ended."""


class LibraryHalfBridge(HalfBridge):
    """One half of the bridge."""

    def __init__(self, inputs: tuple[Any, Any]) -> None:
        super().__init__()
        self._enable: EnablePwm | None = None
        self._pins = inputs
        for pin in inputs:
            pin.output_with_state(0)

    def attach(self, enable: EnablePwm) -> None:
        """Add the PWM, after the inputs were claimed: the kernel does not track who uses a PWM."""
        self._enable = enable

    def set_inputs(self, in1: bool, in2: bool) -> None:
        """Set the levels of IN1 and IN2."""
        with _link_lost_errors():
            for pin, level in zip(self._pins, (in1, in2), strict=True):
                pin.state = level

    def set_enable(self, duty: float) -> None:
        """Set the PWM on EN."""
        if self._enable is not None:
            with _link_lost_errors():
                self._enable.set(duty)

    def close(self) -> None:
        """Set EN low. If that fails, equal inputs at least brake."""
        with suppress(WheelwireError):
            self.set_enable(0.0)
        with suppress(WheelwireError):
            self.set_inputs(False, False)
        if self._enable is not None:
            self._enable.close()
        for pin in self._pins:
            pin.close()


class LibraryGpio(Gpio):
    """The pins of one robot.

    Raises:
        PinsBusy: Another process holds one.
        DriverUnavailable: A library is missing, or a pin or its PWM cannot be claimed.
        ConfigurationError: Both wheels are on one PWM channel.
    """

    left: LibraryHalfBridge
    right: LibraryHalfBridge

    def __init__(self, settings: McuSettings, parameters: Mapping[str, float]) -> None:
        self._factory = pin_factory()
        self._callbacks: list[Callable[[float, int], None]] = []  # pins keep only weak references
        self._open_pins: list[Any] = []
        self._halves: list[LibraryHalfBridge] = []
        try:
            with _driver_unavailable_errors():
                self._start(settings, parameters)
        except BaseException:
            self.close()
            raise

    def ticks(self) -> WheelPair:
        """The ticks that the callbacks have counted."""
        return WheelPair(*(decoder.ticks for decoder in self._decoders))

    def illegal_transitions(self) -> WheelPair:
        """The impossible changes that the callbacks have seen."""
        return WheelPair(*(decoder.illegal for decoder in self._decoders))

    def contact_is_open(self) -> bool:
        """High means open, by the pull-up; true if none is fitted."""
        with _link_lost_errors():
            return self._estop is None or bool(self._estop.state)

    def close(self) -> None:
        """Let both wheels coast and make all pins inputs."""
        for half in self._halves:
            half.close()
        for pin in self._open_pins:
            with suppress(Exception):
                pin.when_changed = None
            pin.close()

    def _start(self, settings: McuSettings, parameters: Mapping[str, float]) -> None:
        pins = settings.pins
        self.left = self._bridge(pins.left_dir1, pins.left_dir2)
        self.right = self._bridge(pins.right_dir1, pins.right_dir2)
        enables = self._open_enables(settings, parameters["pwm_frequency_hz"])
        for half, enable in zip(self._halves, enables, strict=True):
            half.attach(enable)
        self._decoders = [
            self._decoder(pins.left_enc_a, pins.left_enc_b),
            self._decoder(pins.right_enc_a, pins.right_enc_b),
        ]
        self._estop = None if pins.estop is None else self._input(pins.estop)

    def _open_enables(self, settings: McuSettings, frequency_hz: float) -> list[EnablePwm]:
        pins = settings.pins
        channels = kernel_channels(settings)
        if channels is not None:
            pins.check_hardware_pwm()
            self.limits = LIMITS
            return [KernelPwm(channel, frequency_hz) for channel in channels]
        gpios = (pins.left_pwm, pins.right_pwm)
        enables = [LibraryPwm(self._factory.pin(gpio), frequency_hz) for gpio in gpios]
        self.limits = (
            f"PWM at {enables[0].frequency_hz:g} Hz instead of {frequency_hz:g} Hz, in the pin "
            "factory's steps (lgpio: 100), timed by software: for the kernel's, add "
            "dtoverlay=pwm-2chan to config.txt",
            *LIMITS,
        )
        return list(enables)

    def _bridge(self, in1: int, in2: int) -> LibraryHalfBridge:
        half = LibraryHalfBridge((self._factory.pin(in1), self._factory.pin(in2)))
        self._halves.append(half)
        return half

    def _decoder(self, gpio_a: int, gpio_b: int) -> QuadratureDecoder:
        pin_a, pin_b = self._input(gpio_a), self._input(gpio_b)
        decoder = QuadratureDecoder(int(pin_a.state), int(pin_b.state))

        def on_a(time: float, level: int) -> None:
            decoder.change(A, level, time)

        def on_b(time: float, level: int) -> None:
            decoder.change(B, level, time)

        for pin, callback in ((pin_a, on_a), (pin_b, on_b)):
            self._callbacks.append(callback)
            pin.edges = "both"
            pin.when_changed = callback
        return decoder

    def _input(self, gpio: int) -> Any:
        pin = self._factory.pin(gpio)
        self._open_pins.append(pin)
        pin.input_with_pull("up")
        return pin


class EnableLow:
    """For the guard: pulls EN low on both halves of the bridge once the core has released it."""

    def __init__(self, settings: McuSettings) -> None:
        self._channels = kernel_channels(settings)
        self._gpios = (settings.pins.left_pwm, settings.pins.right_pwm)
        if self._channels is None:
            self._factory = pin_factory()

    def __call__(self) -> None:
        """Pull both low, even if one fails. Raises nothing."""
        if self._channels is not None:
            for channel in self._channels:
                channel.switch_off()
            return
        for gpio in self._gpios:
            self._pull_low(gpio)

    def _pull_low(self, gpio: int) -> None:
        end = time.monotonic() + CLAIM_TIMEOUT_S
        while time.monotonic() < end:
            with suppress(Exception):  # each factory has its own errors
                self._factory.pin(gpio).output_with_state(0)
                return
            time.sleep(0.001)


def kernel_channels(settings: McuSettings) -> Any:
    """The kernel's PWM channels of both EN inputs, left and right; None if they have none.

    Raises:
        DriverUnavailable: There are several chips, or the one chosen does not exist.
    """
    gpios = (settings.pins.left_pwm, settings.pins.right_pwm)
    return find_channels(Path(settings.pwm_directory), settings.pwm_chip, gpios)


def pin_factory() -> Any:
    """The pin factory that GPIOZERO_PIN_FACTORY chooses; by default lgpio's.

    gpiozero's own default falls back, with warnings, to factories that miss edges or have no PWM.

    Raises:
        DriverUnavailable: It is not installed, or finds no pins.
    """
    try:
        from gpiozero import Device

        if Device.pin_factory is None:
            if os.environ.get("GPIOZERO_PIN_FACTORY"):
                Device.ensure_pin_factory()
            else:
                from gpiozero.pins.lgpio import LGPIOFactory

                Device.pin_factory = LGPIOFactory()
    except ImportError as error:
        raise DriverUnavailable(
            f"driver 'l298n' needs gpiozero and lgpio ({error}): run pip install 'wheelwire[pi]'"
        ) from error
    except Exception as error:  # each factory has its own errors
        raise DriverUnavailable(
            f"no GPIO on this computer ({error}): run the l298n driver on a Raspberry Pi, as a "
            "user in the group gpio"
        ) from error
    return Device.pin_factory


@contextmanager
def _driver_unavailable_errors() -> Iterator[None]:
    """Turn a pin factory's errors into `DriverUnavailable`, or `PinsBusy`."""
    try:
        yield
    except WheelwireError:
        raise
    except Exception as error:
        if "busy" in str(error).lower():
            raise PinsBusy(
                f"another program uses one of the pins ({error}): end it first"
            ) from error
        raise DriverUnavailable(f"a pin cannot be claimed: {error}") from error


@contextmanager
def _link_lost_errors() -> Iterator[None]:
    """Turn a pin factory's errors on open pins into `LinkLost`."""
    try:
        yield
    except LinkLost:
        raise
    except Exception as error:
        raise LinkLost(f"the pins can no longer be reached: {error}") from error
