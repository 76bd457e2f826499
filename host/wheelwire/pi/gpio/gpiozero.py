"""Pins through gpiozero's pin factory, with the kernel's PWM if available."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from wheelwire_protocol.board import EncoderPulls

from ...board import Pull, WheelPins
from ...errors import ConfigurationError, DriverUnavailable, LinkLost, WheelwireError
from ..encoder import A, B, QuadratureDecoder
from ..settings import McuSettings
from ..storage import runtime_directory
from .base import (
    Gpio,
    PinsBusy,
    StagePins,
    digital_inputs,
    encoder_pins,
    inputs_of,
    pwm_inputs,
    pwm_pins,
    release_pins,
)
from .pwm import EnablePwm, KernelPwm, LibraryPwm, find_channels

LIMITS = ("glitch_filter_ns is not applied: filter the encoder lines in hardware",)
PULLS = {Pull.INTERNAL: "up", Pull.DOWN: "down", Pull.EXTERNAL: "floating"}
"""What a factory calls them."""
LGPIO_FOLDER = "LG_WD"
"""The environment's variable that names lgpio's folder, in place of the working folder."""
CLAIM_TIMEOUT_S = 0.1
"""The kernel releases the lines of a killed process shortly after the process has ended."""


class LibraryStagePins(StagePins):
    """The inputs of one wheel's power stage, all low at first.

    Args:
        levels: The pins of all inputs that are set by level.
        pwm: Names of the inputs that ever take a duty, in the order of `attach`.
    """

    def __init__(self, levels: Mapping[str, Any], pwm: Iterable[str]) -> None:
        super().__init__([*levels, *pwm])
        self._levels = levels
        self._pwm: dict[str, EnablePwm] = {}
        self._shown: dict[str, bool] = {}
        for pin in levels.values():
            pin.output_with_state(0)

    def attach(self, pwm: Mapping[str, EnablePwm]) -> None:
        """Add the PWM, after the pins were claimed: the kernel does not track who uses a PWM."""
        self._pwm = dict(pwm)

    def set_input(self, name: str, duty: float) -> None:
        """Set a level, if it changes, or a duty."""
        with _link_lost_errors():
            if name in self._levels:
                if self._shown.get(name) != bool(duty):
                    self._levels[name].state = bool(duty)
                    self._shown[name] = bool(duty)
            elif name in self._pwm:
                self._pwm[name].set(duty)

    def close(self) -> None:
        """Set all inputs low, the PWM first. If that fails, equal inputs at least brake."""
        # One that cannot be set must not keep the others from being set.
        for name in (*self._pwm, *self._levels):
            with suppress(WheelwireError):
                self.set_input(name, 0.0)
        for pwm in self._pwm.values():
            pwm.close()
        for pin in self._levels.values():
            with suppress(Exception):  # each factory has its own errors
                pin.close()


class LibraryGpio(Gpio):
    """The pins of one robot.

    Raises:
        PinsBusy: Another process holds one.
        DriverUnavailable: A library is missing, or a pin or its PWM cannot be claimed.
    """

    left: LibraryStagePins
    right: LibraryStagePins

    def __init__(self, settings: McuSettings, parameters: Mapping[str, float]) -> None:
        self._factory = pin_factory()
        self._callbacks: list[Callable[[float, int], None]] = []  # pins keep only weak references
        self._open_pins: list[Any] = []
        self._stages: list[LibraryStagePins] = []
        self._inputs: dict[int, Any] = {}
        self.board = settings.board
        try:
            with _driver_unavailable_errors():
                self._start(settings, parameters)
        except BaseException:
            # Release the pins claimed so far: if one is busy, all are opened again a moment later.
            self.close()
            raise

    def contact_level(self) -> bool:
        """As the factory reads it."""
        with _link_lost_errors():
            return bool(self._estop.state)

    def input_levels(self) -> int:
        """As the factory reads them."""
        with _link_lost_errors():
            return sum(bool(pin.state) << channel for channel, pin in self._inputs.items())

    def close(self) -> None:
        """Let both wheels coast and make all pins inputs."""
        for stage in self._stages:
            stage.close()
        for pin in self._open_pins:
            # Each factory has its own errors, and the other pins have to be released.
            with suppress(Exception):
                pin.when_changed = None
            with suppress(Exception):
                pin.close()

    def _start(self, settings: McuSettings, parameters: Mapping[str, float]) -> None:
        board = settings.board
        # Before the PWM: a line has one owner, so a second program fails here and does no harm.
        self.left, self.right = self._stage(board.left), self._stage(board.right)
        duties = self._open_pwm(settings, parameters["pwm_frequency_hz"])
        names = pwm_inputs(board)
        self.left.attach(dict(zip(names, duties[: len(names)], strict=True)))
        self.right.attach(dict(zip(names, duties[len(names) :], strict=True)))
        # Only now, with all inputs low, may the stages follow them.
        if board.standby is not None:
            standby = self._factory.pin(board.standby)
            self._open_pins.append(standby)
            standby.output_with_state(1)
        self.decoders = [
            self._decoder(*encoder_pins(board.left)),
            self._decoder(*encoder_pins(board.right)),
        ]
        if board.estop is not None:
            self._estop = self._input(board.estop, "up")
        for channel, entry in digital_inputs(board).items():
            self._inputs[channel] = self._input(entry.pin or 0, PULLS[entry.pull])

    def _open_pwm(self, settings: McuSettings, frequency_hz: float) -> list[EnablePwm]:
        channels = kernel_channels(settings)
        if channels is not None:
            self.limits = LIMITS
            for channel in channels:
                channel.open(frequency_hz)
            return [*channels]
        gpios = pwm_pins(settings.board)
        enables = [LibraryPwm(self._factory.pin(gpio), frequency_hz) for gpio in gpios]
        self.limits = (
            f"PWM at {enables[0].frequency_hz:g} Hz instead of {frequency_hz:g} Hz, in the pin "
            "factory's steps (lgpio: 100), timed by software: for the kernel's, give each input a "
            "channel of its own (on a Pi 4 GPIO 12 or 18, and 13 or 19) and add "
            "dtoverlay=pwm-2chan to config.txt",
            *LIMITS,
        )
        return list(enables)

    def _stage(self, wheel: WheelPins) -> LibraryStagePins:
        pwm = pwm_inputs(self.board)
        by_level = [name for name in inputs_of(self.board) if name not in pwm]
        levels = {name: self._factory.pin(getattr(wheel, name)) for name in by_level}
        stage = LibraryStagePins(levels, pwm)
        self._stages.append(stage)
        return stage

    def _decoder(self, gpio_a: int, gpio_b: int) -> QuadratureDecoder:
        # Without one an open collector, or a broken wire, would leave the input floating.
        internal = self.board.encoder_pulls is EncoderPulls.INTERNAL
        pull = "up" if internal else "floating"
        pin_a, pin_b = self._input(gpio_a, pull), self._input(gpio_b, pull)
        # The callbacks tell changes, so the levels before them are read here.
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

    def _input(self, gpio: int, pull: str) -> Any:
        pin = self._factory.pin(gpio)
        self._open_pins.append(pin)
        # GPIO 2 and 3 have resistors on the computer's board: the factories refuse any other pull.
        pin.input_with_pull(pin.info.pull or pull)
        return pin


class EnableLow:
    """For the guard: pulls the inputs low that hold the motors off, once the core is gone."""

    def __init__(self, settings: McuSettings) -> None:
        board = settings.board
        self._channels = kernel_channels(settings) or []
        # Where the kernel makes the PWM, switching its channel off is enough.
        by_kernel = pwm_pins(board) if self._channels else ()
        self._gpios = [gpio for gpio in release_pins(board) if gpio not in by_kernel]
        if self._gpios:
            # In advance: importing a pin library takes longer than the wheels may turn on.
            self._factory = pin_factory()

    def __call__(self) -> None:
        """Pull all low, even if one fails. Raises nothing."""
        # The kernel's PWM goes on by itself after the process that had set it.
        for channel in self._channels:
            channel.close()
        for gpio in self._gpios:
            self._pull_low(gpio)

    def _pull_low(self, gpio: int) -> None:
        end = time.monotonic() + CLAIM_TIMEOUT_S
        while time.monotonic() < end:
            with suppress(Exception):  # each factory has its own errors
                self._factory.pin(gpio).output_with_state(0)
                return
            time.sleep(0.001)


def kernel_channels(settings: McuSettings) -> list[KernelPwm] | None:
    """The kernel's PWM channels of `pwm_pins`; None if not all of them have one of their own.

    Raises:
        DriverUnavailable: There are several chips, or the one chosen does not exist.
    """
    directory = Path(settings.pwm_directory)
    return find_channels(directory, settings.pwm_chip, pwm_pins(settings.board))


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
                _give_lgpio_a_folder()
                from gpiozero.pins.lgpio import LGPIOFactory

                Device.pin_factory = LGPIOFactory()
    except ImportError as error:
        raise DriverUnavailable(
            "driver 'l298n' moves this computer's own pins, and needs gpiozero and lgpio for it "
            f"({error}): run pip install 'wheelwire[pi]'. If an ESP32 drives the L298N, write "
            "driver_type: serial"
        ) from error
    except Exception as error:  # each factory has its own errors
        raise DriverUnavailable(
            f"no GPIO on this computer ({error}): {_why_no_gpio(error)}"
        ) from error
    return Device.pin_factory


def _give_lgpio_a_folder() -> None:
    """Lgpio makes a pipe in the working folder, which a service often may not write to."""
    if LGPIO_FOLDER not in os.environ and not os.access(Path.cwd(), os.W_OK):
        with suppress(ConfigurationError, OSError):  # lgpio itself fails then, which is reported
            os.environ[LGPIO_FOLDER] = str(runtime_directory())


def _why_no_gpio(error: Exception) -> str:
    """What to do about it: only where the chip may not be opened it is the user's groups."""
    folder = Path(os.environ.get(LGPIO_FOLDER) or Path.cwd())
    if not os.access(folder, os.W_OK):
        return (
            f"lgpio cannot write to {folder}: set the service's WorkingDirectory, or {LGPIO_FOLDER}"
        )
    chips = sorted(Path("/dev").glob("gpiochip*"))
    if not chips:
        return (
            "run the l298n driver on a Raspberry Pi, whose kernel offers /dev/gpiochip0; if an "
            "ESP32 drives the L298N, write driver_type: serial"
        )
    if not any(os.access(chip, os.R_OK | os.W_OK) for chip in chips):
        return f"{chips[0]} cannot be opened: run it as a user in the group gpio"
    return (
        f"end the other program that uses {chips[0]}"
        if "busy" in str(error).lower()
        else ("look at `gpioinfo`, and at the kernel's log (`dmesg`)")
    )


@contextmanager
def _driver_unavailable_errors() -> Iterator[None]:
    """Turn a pin factory's errors into `DriverUnavailable`, or `PinsBusy`."""
    try:
        yield
    except WheelwireError:
        raise
    except Exception as error:
        # By its text: the factories have no error in common for it.
        if "busy" in str(error).lower():
            raise PinsBusy(
                f"another program uses one of the pins ({error}): end it first"
            ) from error
        raise DriverUnavailable(
            f"a pin cannot be claimed: {error}; check the pins in the robot's file"
        ) from error


@contextmanager
def _link_lost_errors() -> Iterator[None]:
    """Turn a pin factory's errors on open pins into `LinkLost`."""
    try:
        yield
    except LinkLost:
        raise
    except Exception as error:
        raise LinkLost(f"the pins can no longer be reached: {error}") from error
