"""The driver of a robot wired to a Raspberry Pi whose pins pigpiod holds, here or elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from ..errors import DriverUnavailable, WheelwireError
from ..local.driver import LocalDriver
from ..local.hardware import BridgePins, Hardware, WheelPair
from ..local.parameters import default_values
from ..local.pins import Pins
from ..local.quadrature import A, B, QuadratureDecoder
from .pigpio_client import PigpioClient
from .pigpio_watchdog import PigpioWatchdog

DEFAULT_PORT = 8888
FULL_DUTY = 1_000_000


class PigpioBridge(BridgePins):
    """One half of the bridge, its EN on a hardware PWM pin."""

    def __init__(
        self, client: PigpioClient, enable: int, inputs: tuple[int, int], pwm_hz: int
    ) -> None:
        self._client = client
        self._enable = enable
        self._inputs = inputs
        self._pwm_hz = pwm_hz
        self._duty: int | None = None
        self.set_enable(0.0)
        for gpio in inputs:
            client.call("set_mode", gpio, client.library.OUTPUT)
            client.call("write", gpio, 0)

    def set_inputs(self, in1: bool, in2: bool) -> None:
        """The levels of IN1 and IN2."""
        for gpio, level in zip(self._inputs, (in1, in2), strict=True):
            self._client.call("write", gpio, int(level))

    def set_enable(self, duty: float) -> None:
        """Hardware PWM; sent when it changes."""
        wanted = round(duty * FULL_DUTY)
        if wanted != self._duty:
            self._client.call("hardware_PWM", self._enable, self._pwm_hz, wanted)
            self._duty = wanted

    def forget(self) -> None:
        """Somebody else has put EN low: the next duty is sent again."""
        self._duty = None


class PigpioPins(Hardware):
    """A robot's pins behind an open connection, which it closes.

    Raises:
        DriverUnavailable: The daemon refuses the pins, or its hardware PWM.
        LinkLost: It does not answer.
    """

    left: PigpioBridge
    right: PigpioBridge

    def __init__(self, client: PigpioClient, pins: Pins, values: Mapping[str, float]) -> None:
        self._client = client
        self._pins = pins
        try:
            self._start(values)
        except client.library.error as error:
            raise DriverUnavailable(self._reason(str(error.value))) from error

    def ticks(self) -> WheelPair:
        """What the callbacks have counted."""
        self._client.check()
        return WheelPair(*(decoder.ticks for decoder in self._decoders))

    def illegal_transitions(self) -> WheelPair:
        """What they know to have missed."""
        return WheelPair(*(decoder.illegal for decoder in self._decoders))

    def estop_is_open(self) -> bool:
        """High is open, by the pull-up; open where none is fitted."""
        return self._pins.estop is None or bool(self._client.call("read", self._pins.estop))

    def keep_alive(self, now_us: int) -> None:
        """Tell the watchdog in the daemon that the control loop runs."""
        if not self._watchdog.keep_alive(now_us):
            self.left.forget()
            self.right.forget()

    def close(self) -> None:
        """EN low, as far as the daemon can be reached; else its watchdog does it."""
        with suppress(WheelwireError, self._client.library.error):
            self.left.set_enable(0.0)
            self.right.set_enable(0.0)
            self._watchdog.close()
        self._client.close()

    def _start(self, values: Mapping[str, float]) -> None:
        client, pins = self._client, self._pins
        enables = (pins.left_pwm, pins.right_pwm)
        self._watchdog = PigpioWatchdog(client, enables)
        pwm_hz = round(values["pwm_frequency_hz"])
        self.left = PigpioBridge(client, enables[0], (pins.left_dir1, pins.left_dir2), pwm_hz)
        self.right = PigpioBridge(client, enables[1], (pins.right_dir1, pins.right_dir2), pwm_hz)
        filter_us = round(values["glitch_filter_ns"] / 1000)
        self._decoders = [
            self._decoder(pins.left_enc_a, pins.left_enc_b, filter_us),
            self._decoder(pins.right_enc_a, pins.right_enc_b, filter_us),
        ]
        if pins.estop is not None:
            self._input(pins.estop)

    def _decoder(self, gpio_a: int, gpio_b: int, filter_us: int) -> QuadratureDecoder:
        """Fed with the levels in the reports: to read a pin in a callback would be too late."""
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
                f"the pigpiod at {self._client.address} was started with -t 0, which uses up the "
                "PWM hardware: start it without -t"
            )
        return f"the pigpiod at {self._client.address} refuses: {error}"


class PigpioDriver(LocalDriver):
    """A robot behind a pigpio daemon.

    Args:
        host: Where the daemon runs.
        port: Its TCP port.
        pins: The wiring.
        parameters: Values that differ from the defaults, by name.
        store: A JSON file that keeps parameters which are saved at run time.

    Raises:
        DriverUnavailable: The library is not installed, no daemon answers, or it refuses.
        ConfigurationError: The pins do not fit.
    """

    def __init__(
        self,
        host: str = "localhost",
        port: int = DEFAULT_PORT,
        *,
        pins: Pins | None = None,
        parameters: Mapping[str, float] | None = None,
        store: Path | None = None,
    ) -> None:
        wiring = pins or Pins()
        wiring.check_hardware_pwm()
        values = default_values({**wiring.implied_parameters(), **(parameters or {})})
        super().__init__(
            f"pigpio {host}:{port}",
            lambda: _open(host, port, wiring, values),
            values,
            store,
        )


def _open(host: str, port: int, pins: Pins, values: Mapping[str, float]) -> PigpioPins:
    client = PigpioClient(host, port)
    try:
        return PigpioPins(client, pins, values)
    except BaseException:
        client.close()
        raise
