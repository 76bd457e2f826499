"""The driver of a robot whose L298N and encoders are wired to this Raspberry Pi's own pins."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import DriverUnavailable, LinkLost, WheelwireError
from ..local.driver import LocalDriver
from ..local.hardware import BridgePins, Hardware, WheelPair
from ..local.parameters import default_values
from ..local.pins import Pins
from ..local.quadrature import A, B, QuadratureDecoder
from .enable_pwm import CLASS_DIRECTORY, EnablePwm, KernelPwm, LibraryPwm, find_chip

LIMITS = (
    "nothing stops the wheels of a program that was killed: EN stays as it was",
    "glitch_filter_ns is not applied: filter the encoder's lines by hardware",
)


class GpioBridge(BridgePins):
    """One half of the bridge."""

    def __init__(self, inputs: tuple[Any, Any], enable: EnablePwm) -> None:
        self._enable = enable
        self._inputs = inputs
        for pin in inputs:
            pin.output_with_state(0)

    def set_inputs(self, in1: bool, in2: bool) -> None:
        """The levels of IN1 and IN2."""
        with _pins_in_reach():
            for pin, level in zip(self._inputs, (in1, in2), strict=True):
                pin.state = level

    def set_enable(self, duty: float) -> None:
        """PWM on EN."""
        with _pins_in_reach():
            self._enable.set(duty)

    def close(self) -> None:
        """EN low; where it is out of reach, equal inputs brake at least."""
        with suppress(WheelwireError):
            self.set_enable(0.0)
        with suppress(WheelwireError):
            self.set_inputs(False, False)
        self._enable.close()
        for pin in self._inputs:
            pin.close()


class GpioPins(Hardware):
    """A robot's pins through a gpiozero pin factory.

    Raises:
        DriverUnavailable: A pin or its PWM cannot be had.
    """

    left: GpioBridge
    right: GpioBridge

    def __init__(
        self,
        factory: Any,
        pins: Pins,
        values: Mapping[str, float],
        pwm_directory: Path,
        pwm_chip: int | None,
    ) -> None:
        self._factory = factory
        self._callbacks: list[Callable[[float, int], None]] = []  # pins hold them weakly
        self._encoder_pins: list[Any] = []
        self._estop = factory.pin(pins.estop) if pins.estop is not None else None
        frequency_hz = values["pwm_frequency_hz"]
        enables = self._open_enables(pins, frequency_hz, pwm_directory, pwm_chip)
        self.left = self._bridge(pins.left_dir1, pins.left_dir2, enables[0])
        self.right = self._bridge(pins.right_dir1, pins.right_dir2, enables[1])
        self._decoders = [
            self._decoder(pins.left_enc_a, pins.left_enc_b),
            self._decoder(pins.right_enc_a, pins.right_enc_b),
        ]
        if self._estop is not None:
            self._estop.input_with_pull("up")

    def ticks(self) -> WheelPair:
        """What the callbacks have counted."""
        return WheelPair(*(decoder.ticks for decoder in self._decoders))

    def illegal_transitions(self) -> WheelPair:
        """What they know to have missed."""
        return WheelPair(*(decoder.illegal for decoder in self._decoders))

    def estop_is_open(self) -> bool:
        """High is open, by the pull-up; open where none is fitted."""
        with _pins_in_reach():
            return self._estop is None or bool(self._estop.state)

    def close(self) -> None:
        """Both wheels coast; all pins become inputs."""
        self.left.close()
        self.right.close()
        for pin in (*self._encoder_pins, *filter(None, [self._estop])):
            pin.when_changed = None
            pin.close()

    def _open_enables(
        self, pins: Pins, frequency_hz: float, directory: Path, number: int | None
    ) -> list[EnablePwm]:
        gpios = (pins.left_pwm, pins.right_pwm)
        found = find_chip(directory, number)
        if found is not None and all(gpio in found[1] for gpio in gpios):
            chip, channels = found
            pins.check_hardware_pwm()
            self.limits = LIMITS
            return [KernelPwm(chip, channels[gpio], frequency_hz) for gpio in gpios]
        enables = [LibraryPwm(self._factory.pin(gpio), frequency_hz) for gpio in gpios]
        self.limits = (
            f"PWM at {enables[0].frequency_hz:g} Hz instead of {frequency_hz:g} Hz, in the pin "
            "factory's steps (lgpio: 100), timed by software: for the kernel's, add "
            "dtoverlay=pwm-2chan to config.txt",
            *LIMITS,
        )
        return list(enables)

    def _bridge(self, in1: int, in2: int, enable: EnablePwm) -> GpioBridge:
        return GpioBridge((self._factory.pin(in1), self._factory.pin(in2)), enable)

    def _decoder(self, gpio_a: int, gpio_b: int) -> QuadratureDecoder:
        pin_a, pin_b = self._factory.pin(gpio_a), self._factory.pin(gpio_b)
        for pin in (pin_a, pin_b):
            pin.input_with_pull("up")
            pin.edges = "both"
            self._encoder_pins.append(pin)
        decoder = QuadratureDecoder(int(pin_a.state), int(pin_b.state))

        def on_a(time: float, level: int) -> None:
            decoder.change(A, level, time)

        def on_b(time: float, level: int) -> None:
            decoder.change(B, level, time)

        self._callbacks += [on_a, on_b]
        pin_a.when_changed = on_a
        pin_b.when_changed = on_b
        return decoder


class L298NDriver(LocalDriver):
    """A robot on this computer's pins, through gpiozero's pin factory.

    Args:
        pins: The wiring.
        pwm_chip: Number of the kernel's PWM chip, where there are several.
        parameters: Values that differ from the defaults, by name.
        store: A JSON file that keeps parameters which are saved at run time.
        pwm_directory: Where the kernel's PWM is.

    Raises:
        DriverUnavailable: gpiozero is not installed, finds no pins, or a pin cannot be had.
        ConfigurationError: The pins do not fit.
    """

    def __init__(
        self,
        *,
        pins: Pins | None = None,
        pwm_chip: int | None = None,
        parameters: Mapping[str, float] | None = None,
        store: Path | None = None,
        pwm_directory: Path = CLASS_DIRECTORY,
    ) -> None:
        wiring = pins or Pins()
        values = default_values({**wiring.implied_parameters(), **(parameters or {})})
        super().__init__(
            "l298n",
            lambda: GpioPins(_factory(), wiring, values, pwm_directory, pwm_chip),
            values,
            store,
        )


def _factory() -> Any:
    """gpiozero's, if the program or GPIOZERO_PIN_FACTORY has chosen one; else lgpio's.

    gpiozero itself would fall back, with warnings, on factories that miss edges or have no PWM.
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
            f"driver 'l298n' needs gpiozero and lgpio ({error}): pip install 'wheelwire[gpio]'"
        ) from error
    except Exception as error:  # each factory has its own
        raise DriverUnavailable(
            f"no GPIO here ({error}): the l298n driver runs on a Raspberry Pi, with the user in "
            "the group gpio"
        ) from error
    return Device.pin_factory


@contextmanager
def _pins_in_reach() -> Iterator[None]:
    """Whatever a pin factory raises means that the pins are lost."""
    try:
        yield
    except LinkLost:
        raise
    except Exception as error:
        raise LinkLost(f"the pins are out of reach: {error}") from error
