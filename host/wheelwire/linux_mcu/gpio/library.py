"""A robot's pins through gpiozero's pin factory, with the kernel's PWM where there is one."""

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

LIMITS = ("glitch_filter_ns is not applied: filter the encoder's lines by hardware",)
CLAIM_S = 0.1
"""The kernel frees a killed process's lines a moment after the process is gone."""


class LibraryHalfBridge(HalfBridge):
    """One half of the bridge."""

    def __init__(self, inputs: tuple[Any, Any]) -> None:
        super().__init__()
        self._enable: EnablePwm | None = None
        self._pins = inputs
        for pin in inputs:
            pin.output_with_state(0)

    def attach(self, enable: EnablePwm) -> None:
        """The PWM, once the inputs are ours: the kernel's PWM itself has no owner."""
        self._enable = enable

    def set_inputs(self, in1: bool, in2: bool) -> None:
        """The levels of IN1 and IN2."""
        with _pins_in_reach():
            for pin, level in zip(self._pins, (in1, in2), strict=True):
                pin.state = level

    def set_enable(self, duty: float) -> None:
        """PWM on EN."""
        if self._enable is not None:
            with _pins_in_reach():
                self._enable.set(duty)

    def close(self) -> None:
        """EN low; where it is out of reach, equal inputs brake at least."""
        with suppress(WheelwireError):
            self.set_enable(0.0)
        with suppress(WheelwireError):
            self.set_inputs(False, False)
        if self._enable is not None:
            self._enable.close()
        for pin in self._pins:
            pin.close()


class LibraryGpio(Gpio):
    """A robot's pins.

    Raises:
        PinsBusy: Another process holds one.
        DriverUnavailable: A library is missing, or a pin or its PWM cannot be had.
        ConfigurationError: Both wheels are on one PWM channel.
    """

    left: LibraryHalfBridge
    right: LibraryHalfBridge

    def __init__(self, settings: McuSettings, parameters: Mapping[str, float]) -> None:
        self._factory = pin_factory()
        self._callbacks: list[Callable[[float, int], None]] = []  # pins hold them weakly
        self._open_pins: list[Any] = []
        self._halves: list[LibraryHalfBridge] = []
        try:
            with _refusals():
                self._start(settings, parameters)
        except BaseException:
            self.close()
            raise

    def ticks(self) -> WheelPair:
        """What the callbacks have counted."""
        return WheelPair(*(decoder.ticks for decoder in self._decoders))

    def illegal_transitions(self) -> WheelPair:
        """What they know to have missed."""
        return WheelPair(*(decoder.illegal for decoder in self._decoders))

    def contact_is_open(self) -> bool:
        """High is open, by the pull-up; open where none is fitted."""
        with _pins_in_reach():
            return self._estop is None or bool(self._estop.state)

    def close(self) -> None:
        """Both wheels coast; all pins become inputs."""
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
    """For the guard, once nobody else holds EN: pulls it low on both halves of the bridge."""

    def __init__(self, settings: McuSettings) -> None:
        self._channels = kernel_channels(settings)
        self._gpios = (settings.pins.left_pwm, settings.pins.right_pwm)
        if self._channels is None:
            self._factory = pin_factory()

    def __call__(self) -> None:
        """Both, whatever fails: raises nothing."""
        if self._channels is not None:
            for channel in self._channels:
                channel.switch_off()
            return
        for gpio in self._gpios:
            self._pull_low(gpio)

    def _pull_low(self, gpio: int) -> None:
        end = time.monotonic() + CLAIM_S
        while time.monotonic() < end:
            with suppress(Exception):  # each factory has its own
                self._factory.pin(gpio).output_with_state(0)
                return
            time.sleep(0.001)


def kernel_channels(settings: McuSettings) -> Any:
    """The kernel's PWM of both EN inputs, left and right; None where they have none.

    Raises:
        DriverUnavailable: There are several chips, or not the one asked for.
    """
    gpios = (settings.pins.left_pwm, settings.pins.right_pwm)
    return find_channels(Path(settings.pwm_directory), settings.pwm_chip, gpios)


def pin_factory() -> Any:
    """gpiozero's, if GPIOZERO_PIN_FACTORY has chosen one; else lgpio's.

    gpiozero itself would fall back, with warnings, on factories that miss edges or have no PWM.

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
            f"driver 'l298n' needs gpiozero and lgpio ({error}): pip install 'wheelwire[pi]'"
        ) from error
    except Exception as error:  # each factory has its own
        raise DriverUnavailable(
            f"no GPIO here ({error}): the l298n driver runs on a Raspberry Pi, with the user in "
            "the group gpio"
        ) from error
    return Device.pin_factory


@contextmanager
def _refusals() -> Iterator[None]:
    """What a pin factory raises for a pin that cannot be had."""
    try:
        yield
    except WheelwireError:
        raise
    except Exception as error:
        if "busy" in str(error).lower():
            raise PinsBusy(
                f"another program uses one of the pins ({error}): end it first"
            ) from error
        raise DriverUnavailable(f"a pin cannot be had: {error}") from error


@contextmanager
def _pins_in_reach() -> Iterator[None]:
    """Whatever a pin factory raises means that the pins are lost."""
    try:
        yield
    except LinkLost:
        raise
    except Exception as error:
        raise LinkLost(f"the pins are out of reach: {error}") from error
