"""Pins of a pigpio daemon, on this computer or another one."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from ...errors import DriverUnavailable, WheelwireError
from ..encoder import A, B, QuadratureDecoder
from ..settings import McuSettings
from .base import Gpio, HalfBridge, WheelPair
from .pigpio_client import PigpioClient
from .pigpio_watchdog import PigpioWatchdog

FULL_DUTY = 1_000_000


class PigpiodHalfBridge(HalfBridge):
    """One half of the bridge, with EN on a hardware PWM pin."""

    def __init__(
        self, client: PigpioClient, enable: int, inputs: tuple[int, int], pwm_hz: int
    ) -> None:
        super().__init__()
        self._client = client
        self._enable = enable
        self._gpios = inputs
        self._pwm_hz = pwm_hz
        self._duty: int | None = None
        self.set_enable(0.0)
        for gpio in inputs:
            client.call("set_mode", gpio, client.library.OUTPUT)
            client.call("write", gpio, 0)

    def set_inputs(self, in1: bool, in2: bool) -> None:
        """Set the levels of IN1 and IN2."""
        for gpio, level in zip(self._gpios, (in1, in2), strict=True):
            self._client.call("write", gpio, int(level))

    def set_enable(self, duty: float) -> None:
        """Set the hardware PWM on EN; sent only when it changes."""
        wanted = round(duty * FULL_DUTY)
        if wanted != self._duty:
            self._client.call("hardware_PWM", self._enable, self._pwm_hz, wanted)
            self._duty = wanted

    def forget(self) -> None:
        """Note that the watchdog has pulled EN low: the next duty must be sent again."""
        self._duty = None


class PigpiodGpio(Gpio):
    """The pins of one robot.

    Raises:
        PinsBusy: Another program uses them.
        DriverUnavailable: No daemon answers, or it refuses the pins or its hardware PWM.
        ConfigurationError: Both wheels are on one PWM channel.
        LinkLost: The daemon no longer answers.
    """

    left: PigpiodHalfBridge
    right: PigpiodHalfBridge

    def __init__(self, settings: McuSettings, parameters: Mapping[str, float]) -> None:
        self._pins = settings.pins
        self._pins.check_hardware_pwm()
        self._client = PigpioClient(settings.host, settings.port)
        try:
            self._start(parameters)
        except self._client.library.error as error:
            self._client.close()
            raise DriverUnavailable(self._reason(str(error.value))) from error
        except BaseException:
            self._client.close()
            raise

    def ticks(self) -> WheelPair:
        """The ticks that the callbacks have counted."""
        self._client.check()
        return WheelPair(*(decoder.ticks for decoder in self._decoders))

    def illegal_transitions(self) -> WheelPair:
        """The impossible changes that the callbacks have seen."""
        return WheelPair(*(decoder.illegal for decoder in self._decoders))

    def contact_is_open(self) -> bool:
        """High means open, by the pull-up; true if none is fitted."""
        return self._pins.estop is None or bool(self._client.call("read", self._pins.estop))

    def keep_alive(self, now_us: int) -> None:
        """Refresh the watchdog script in the daemon."""
        if not self._watchdog.keep_alive(now_us):
            self.left.forget()
            self.right.forget()

    def close(self) -> None:
        """Pull EN low; if the daemon cannot be reached, its watchdog script does so."""
        with suppress(WheelwireError, self._client.library.error):
            self.left.set_enable(0.0)
            self.right.set_enable(0.0)
            self._watchdog.close()
        self._client.close()

    def _start(self, parameters: Mapping[str, float]) -> None:
        client, pins = self._client, self._pins
        enables = (pins.left_pwm, pins.right_pwm)
        # First: from here on EN goes low by itself if this process dies.
        self._watchdog = PigpioWatchdog(client, enables)
        pwm_hz = round(parameters["pwm_frequency_hz"])
        self.left = PigpiodHalfBridge(client, enables[0], (pins.left_dir1, pins.left_dir2), pwm_hz)
        self.right = PigpiodHalfBridge(
            client, enables[1], (pins.right_dir1, pins.right_dir2), pwm_hz
        )
        filter_us = round(parameters["glitch_filter_ns"] / 1000)
        self._decoders = [
            self._decoder(pins.left_enc_a, pins.left_enc_b, filter_us),
            self._decoder(pins.right_enc_a, pins.right_enc_b, filter_us),
        ]
        if pins.estop is not None:
            self._input(pins.estop)

    def _decoder(self, gpio_a: int, gpio_b: int, filter_us: int) -> QuadratureDecoder:
        """Decode the levels in the daemon's reports: a callback would read a pin too late."""
        client = self._client
        for gpio in (gpio_a, gpio_b):
            self._input(gpio)
            client.call("set_glitch_filter", gpio, filter_us)
        decoder = QuadratureDecoder(client.call("read", gpio_a), client.call("read", gpio_b))

        def on_a(_: int, level: int, tick: int) -> None:
            decoder.change(A, level, tick)

        def on_b(_: int, level: int, tick: int) -> None:
            decoder.change(B, level, tick)

        client.call("callback", gpio_a, client.library.EITHER_EDGE, on_a)
        client.call("callback", gpio_b, client.library.EITHER_EDGE, on_b)
        return decoder

    def _input(self, gpio: int) -> None:
        self._client.call("set_mode", gpio, self._client.library.INPUT)
        self._client.call("set_pull_up_down", gpio, self._client.library.PUD_UP)

    def _reason(self, error: str) -> str:
        library = self._client.library
        if error == library.error_text(library.PI_HPWM_ILLEGAL):
            return (
                f"the pigpiod at {self._client.address} was started with -t 0, which takes the PWM "
                "hardware for its own timing: start it without -t"
            )
        return f"the pigpiod at {self._client.address} refused: {error}"
