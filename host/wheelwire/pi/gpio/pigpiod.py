"""Pins of a pigpio daemon, on this computer or another one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress

from wheelwire_protocol.board import EncoderPulls

from ...board import Pull
from ...errors import DriverUnavailable, WheelwireError
from ..encoder import A, B, QuadratureDecoder
from ..settings import McuSettings
from .base import (
    PWM_CHANNEL,
    Gpio,
    StagePins,
    WheelPair,
    digital_inputs,
    encoder_pins,
    inputs_of,
    pwm_inputs,
    pwm_pins,
    release_inputs,
    release_pins,
)
from .pigpio_client import PigpioClient
from .pigpio_watchdog import PigpioWatchdog

FULL_DUTY = 1_000_000
SOFTWARE_RANGE = 1000
SOFTWARE_LIMIT = (
    "the PWM is timed by pigpiod, 8 kHz at most: only GPIO 12 or 18 and 13 or 19 have hardware "
    "PWM, and each input needs a channel of its own"
)


class PigpiodStagePins(StagePins):
    """The inputs of one wheel's power stage, all low at first.

    Args:
        client: An open connection.
        levels: The GPIOs of the inputs that are set by level.
        pwm: Those of the inputs that take a duty.
        pwm_hz: Its frequency.
        by_hardware: Whether all of them have a channel of the PWM hardware; else the daemon times
            the edges, in steps of 5 us.
    """

    def __init__(
        self,
        client: PigpioClient,
        levels: Mapping[str, int],
        pwm: Mapping[str, int],
        pwm_hz: int,
        *,
        by_hardware: bool,
    ) -> None:
        super().__init__([*levels, *pwm])
        self._client = client
        self._levels = levels
        self._pwm = pwm
        self._pwm_hz = pwm_hz
        self._by_hardware = by_hardware
        self._sent: dict[str, int] = {}
        if not by_hardware:
            for gpio in pwm.values():
                client.call("set_PWM_frequency", gpio, pwm_hz)
                client.call("set_PWM_range", gpio, SOFTWARE_RANGE)
        for name in pwm:
            self.set_input(name, 0.0)
        for name, gpio in levels.items():
            client.call("set_mode", gpio, client.library.OUTPUT)
            self.set_input(name, 0.0)

    def set_input(self, name: str, duty: float) -> None:
        """Set a level or a duty; sent only when it changes."""
        full = 1 if name in self._levels else FULL_DUTY if self._by_hardware else SOFTWARE_RANGE
        wanted = round(duty * full)
        # Each call is a round trip to the daemon, perhaps over a network.
        if wanted == self._sent.get(name):
            return
        if name in self._levels:
            self._client.call("write", self._levels[name], wanted)
        elif self._by_hardware:
            self._client.call("hardware_PWM", self._pwm[name], self._pwm_hz, wanted)
        else:
            self._client.call("set_PWM_dutycycle", self._pwm[name], wanted)
        # Only once the daemon has taken it: what failed is sent again.
        self._sent[name] = wanted

    def forget(self) -> None:
        """Note that the watchdog has pulled inputs low: all must be sent again."""
        self._sent.clear()

    def release(self, names: Iterable[str]) -> None:
        """Pull these low."""
        for name in names:
            self.set_input(name, 0.0)


class PigpiodGpio(Gpio):
    """The pins of one robot.

    Raises:
        PinsBusy: Another program uses them.
        DriverUnavailable: No daemon answers, or it refuses the pins or its hardware PWM.
        LinkLost: The daemon no longer answers.
    """

    left: PigpiodStagePins
    right: PigpiodStagePins

    def __init__(self, settings: McuSettings, parameters: Mapping[str, float]) -> None:
        self.board = settings.board
        self._inputs: dict[int, int] = {}
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
        # Here, because it is asked for in each step: a daemon that is gone is noticed at once.
        self._client.check()
        return super().ticks()

    def contact_level(self) -> bool:
        """As the daemon reads it."""
        return bool(self._client.call("read", self.board.estop))

    def input_levels(self) -> int:
        """As the daemon reads them, all at once."""
        if not self._inputs:
            return 0  # each call is a round trip
        bank = self._client.call("read_bank_1")
        return sum((bank >> gpio & 1) << channel for channel, gpio in self._inputs.items())

    def keep_alive(self, now_us: int) -> None:
        """Refresh the watchdog script in the daemon."""
        if not self._watchdog.keep_alive(now_us):
            # The script had ended: its pins are low, whatever was sent before.
            self.left.forget()
            self.right.forget()
            self._end_standby()

    def close(self) -> None:
        """Pull EN low; if the daemon cannot be reached, its watchdog script does so."""
        with suppress(WheelwireError, self._client.library.error):
            self.left.release(release_inputs(self.board))
            self.right.release(release_inputs(self.board))
            # Last: until the inputs are low, the script has to be there to pull them.
            self._watchdog.close()
        self._client.close()

    def _start(self, parameters: Mapping[str, float]) -> None:
        client, board = self._client, self.board
        # First: from here on the motors are held off if this process dies.
        self._watchdog = PigpioWatchdog(client, release_pins(board))
        gpios = pwm_pins(board)
        channels = {PWM_CHANNEL.get(gpio) for gpio in gpios}
        # None is a GPIO without a channel. Two GPIOs on one channel would carry the same signal.
        by_hardware = None not in channels and len(channels) == len(gpios)
        if not by_hardware:
            self.limits = (SOFTWARE_LIMIT,)
        self.left, self.right = (
            PigpiodStagePins(
                client,
                {n: getattr(wheel, n) for n in inputs_of(board) if n not in pwm_inputs(board)},
                {n: getattr(wheel, n) for n in pwm_inputs(board)},
                round(parameters["pwm_frequency_hz"]),
                by_hardware=by_hardware,
            )
            for wheel in (board.left, board.right)
        )
        # Only now, with all inputs low, may the stages follow them.
        self._end_standby()
        # The daemon's filter counts whole microseconds.
        filter_us = round(parameters["glitch_filter_ns"] / 1000)
        self.decoders = [
            self._decoder(*encoder_pins(board.left), filter_us),
            self._decoder(*encoder_pins(board.right), filter_us),
        ]
        if board.estop is not None:
            self._input(board.estop, client.library.PUD_UP)
        library = client.library
        pulls = {Pull.INTERNAL: library.PUD_UP, Pull.DOWN: library.PUD_DOWN}
        for channel, entry in digital_inputs(board).items():
            self._inputs[channel] = entry.pin or 0
            self._input(entry.pin or 0, pulls.get(entry.pull, library.PUD_OFF))

    def _end_standby(self) -> None:
        """Let the stages follow their inputs; the watchdog script pulls standby low, too."""
        standby, client = self.board.standby, self._client
        if standby is not None:
            client.call("set_mode", standby, client.library.OUTPUT)
            client.call("write", standby, 1)

    def _decoder(self, gpio_a: int, gpio_b: int, filter_us: int) -> QuadratureDecoder:
        """Decode the levels in the daemon's reports: a callback would read a pin too late."""
        client = self._client
        # Without one an open collector, or a broken wire, would leave the input floating.
        internal = self.board.encoder_pulls is EncoderPulls.INTERNAL
        pull = client.library.PUD_UP if internal else client.library.PUD_OFF
        for gpio in (gpio_a, gpio_b):
            self._input(gpio, pull)
            client.call("set_glitch_filter", gpio, filter_us)
        # The callbacks tell changes, so the levels before them are read here.
        decoder = QuadratureDecoder(client.call("read", gpio_a), client.call("read", gpio_b))

        # Edges within one sample have the same tick: the decoder then knows no order of them.
        def on_a(_: int, level: int, tick: int) -> None:
            decoder.change(A, level, tick)

        def on_b(_: int, level: int, tick: int) -> None:
            decoder.change(B, level, tick)

        client.call("callback", gpio_a, client.library.EITHER_EDGE, on_a)
        client.call("callback", gpio_b, client.library.EITHER_EDGE, on_b)
        return decoder

    def _input(self, gpio: int, pull: int) -> None:
        self._client.call("set_mode", gpio, self._client.library.INPUT)
        self._client.call("set_pull_up_down", gpio, pull)

    def _reason(self, error: str) -> str:
        library = self._client.library
        if error == library.error_text(library.PI_HPWM_ILLEGAL):
            return (
                f"the pigpiod at {self._client.address} was started with -t 0, which takes the PWM "
                "hardware for its own timing: start it without -t"
            )
        return f"the pigpiod at {self._client.address} refused: {error}"
