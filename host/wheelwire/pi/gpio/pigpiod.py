"""Pins of a pigpio daemon, on this computer or another one.

The daemon leaves its pins unchanged when a client dies or the network fails: `PigpioWatchdog` is a
script in it that then stops the wheels. pigpio's client (1.78, its last) waits forever for an
answer that does not come, and its callback thread spins when the daemon closes the connection:
`PigpioClient` works around both, from outside.
"""

from __future__ import annotations

import atexit
import socket
import struct
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

from wheelwire_protocol.board import EncoderPulls

from ...board import Pull
from ...errors import DriverUnavailable, LinkLost, WheelwireError
from ..encoder import A, B, QuadratureDecoder
from ..settings import McuSettings
from .base import (
    PWM_CHANNEL,
    Gpio,
    PinsBusy,
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

CONNECT_TIMEOUT_S = 3.0
ANSWER_TIMEOUT_S = 0.5
"""The daemon answers within a millisecond, over a wireless network within some tens."""
JOIN_S = 0.5


class PigpioClient:
    """An open connection to a daemon.

    Args:
        host: The daemon's computer.
        port: Its TCP port.

    Raises:
        DriverUnavailable: The library is not installed, or no daemon answers.
    """

    def __init__(self, host: str, port: int) -> None:
        try:
            import pigpio
        except ImportError as error:
            raise DriverUnavailable(
                "driver 'pigpio' moves this computer's own pins and needs pigpio's client: run "
                "pip install 'wheelwire[pi]'. With an ESP32 write driver_type: serial"
            ) from error
        self.library = pigpio
        self.address = f"{host}:{port}"
        _probe(host, port, self.address)
        with _threads_that_end(pigpio):
            self._pi = pigpio.pi(host, port, show_errors=False)
        if not self._pi.connected:
            raise DriverUnavailable(
                f"the program at {self.address} is not pigpiod: give another host or port"
            )
        # pigpio's exit handler would close the connection before ours has stopped the wheels.
        atexit.unregister(self._pi.stop)
        self._pi.sl.s.settimeout(ANSWER_TIMEOUT_S)
        self._closed = False
        # Kept, because the client's `stop` forgets the thread that `close` has to join.
        self._notify = self._pi._notify
        self._notify_socket: _EndingSocket = self._notify.sl.s

    def call(self, method: str, *arguments: object) -> Any:
        """Call a method of `pigpio.pi` and return its result.

        Raises:
            LinkLost: No answer, or the connection is closed. This client cannot be used again.
            pigpio.error: The daemon refused the call.
        """
        self.check()
        try:
            return getattr(self._pi, method)(*arguments)
        except (OSError, struct.error) as error:  # struct.error: a truncated answer
            raise LinkLost(
                f"pigpiod at {self.address} does not answer: {error}; check the daemon "
                "and the network"
            ) from error

    def check(self) -> None:
        """Raise `LinkLost` if the daemon has closed the connection."""
        if self._closed or not self._notify.is_alive():
            raise LinkLost(f"pigpiod at {self.address} has closed the connection; start it again")

    def close(self) -> None:
        """Close both connections and end the callback thread."""
        self._closed = True
        with suppress(OSError):
            self._pi.stop()
        self._notify.join(JOIN_S)  # it ends by itself if the daemon acknowledges the close
        # Otherwise it waits in `recv`: a shutdown wakes it, but closing the socket would not.
        self._notify_socket.shutdown()
        self._notify.join(JOIN_S)
        self._notify_socket.close()


@contextmanager
def _threads_that_end(library: Any) -> Iterator[None]:
    """A block in which pigpio creates callback threads that end with their connection."""
    thread_class = library._callback_thread

    class CallbackThread(thread_class):  # type: ignore[misc, valid-type] # pigpio has no types
        def start(self) -> None:  # pigpio calls it once the socket is connected
            self.sl.s = _EndingSocket(self)
            super().start()

    library._callback_thread = CallbackThread
    try:
        yield
    finally:
        # Others that use pigpio in this process get its own class.
        library._callback_thread = thread_class


class _EndingSocket:
    """Replaces the socket of the callback thread: when it is closed, the thread ends."""

    def __init__(self, thread: Any) -> None:
        self._socket: socket.socket = thread.sl.s
        self._thread = thread

    def recv(self, size: int) -> bytes:
        try:
            data = self._socket.recv(size)
        except OSError:
            data = b""
        if not data:
            # Otherwise the thread would read nothing again and again.
            self._thread.go = False
        return data

    def send(self, data: bytes) -> None:
        # The thread's `stop` sends a last command, also to a daemon that is gone.
        with suppress(OSError):
            self._socket.send(data)

    def close(self) -> None:
        self._socket.close()

    def shutdown(self) -> None:
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)


def _probe(host: str, port: int, address: str) -> None:
    """Connect once with a time-out and a reason, which pigpio's own attempt lacks."""
    try:
        socket.create_connection((host, port), CONNECT_TIMEOUT_S).close()
    except OSError as error:
        raise DriverUnavailable(
            f"no pigpiod at {address} ({error}): start it with `sudo systemctl start pigpiod`, "
            "or give host and port"
        ) from error


CHECK_MS = 10
CHECKS = 11
"""The pins go low one check after these many have counted down to zero: 0.11 to 0.12 s after the
last refresh."""
REFRESH_US = 20_000
SCRIPT_MARK = 0x57574C01
"""Marks Wheelwire's scripts, in their last parameter."""
MAX_SCRIPTS = 32
FIRST_START_S = 1.0
LONGEST_DELAY_S = 1.0
"""A program that the computer delays longer is taken for killed by the next one that opens."""


class PigpioWatchdog:
    """The running script; `close` removes it.

    Args:
        client: An open connection.
        pins: The GPIOs that hold the motors off when they are low: at most 8.

    Raises:
        PinsBusy: Another program drives these pins.
    """

    def __init__(self, client: PigpioClient, pins: tuple[int, ...]) -> None:
        self._client = client
        self._library = client.library
        # Sorted, so that `_scripts` recognises a script for the same pins.
        self._pins = sorted(pins)
        # The ten that a script has: the counter, up to eight pins, the mark.
        self._parameters = [CHECKS, *self._pins, *[0] * (8 - len(pins)), SCRIPT_MARK]
        self._next_us = 0
        self._claim()
        writes = " ".join(f"w {gpio} 0" for gpio in pins)
        # Each round: wait CHECK_MS, decrement p0, repeat while it is not negative (`jp` also jumps
        # at zero); then all low.
        script = f"tag 0 mils {CHECK_MS} dcr p0 jp 0 {writes} halt"
        self._id: int = client.call("store_script", script.encode())
        self._run()
        # Another program may have started at the same time. If both see it, neither drives.
        if any(other != self._id for other in self._scripts()):
            self.close()
            raise self._busy()

    def keep_alive(self, now_us: int) -> bool:
        """Refresh the script from time to time. False if it had ended: EN is low then."""
        if now_us < self._next_us:
            return True
        self._next_us = now_us + REFRESH_US
        status, _ = self._status(self._id)
        # New parameters do not start a script that has ended: it is run again.
        if status != self._library.PI_SCRIPT_RUNNING:
            self._run()
            return False
        self._client.call("update_script", self._id, self._parameters)
        return True

    def close(self) -> None:
        """Delete the script, which stops it.

        In one call: between two, another program could take a stopped script's number for its own.
        """
        self._client.call("delete_script", self._id)

    def _run(self) -> None:
        # A script that was just stored is still being set up, and cannot be run before.
        self._wait_while(self._id, self._library.PI_SCRIPT_INITING, FIRST_START_S)
        self._client.call("run_script", self._id, self._parameters)

    def _claim(self) -> None:
        """Delete the script of a killed program; refuse if a program is there that refreshes it."""
        running, ended = self._library.PI_SCRIPT_RUNNING, self._library.PI_SCRIPT_HALTED
        for script_id in self._scripts():
            # A script that is not refreshed ends within its countdown. If it still runs after twice
            # that time, a program is refreshing it.
            self._wait_while(script_id, running, 2 * CHECKS * CHECK_MS / 1000)
            # A program that the computer has delayed starts it again; one that was killed never
            # does. Another program may have deleted it meanwhile, or put its own in its place.
            if not self._wait_while(script_id, ended, LONGEST_DELAY_S):
                with suppress(self._library.error):
                    self._client.call("delete_script", script_id)
            elif self._status(script_id)[0] == running:
                raise self._busy()

    def _scripts(self) -> Iterator[int]:
        """Those for these pins."""
        for script_id in range(MAX_SCRIPTS):
            _, parameters = self._status(script_id)
            if parameters and parameters[1:] == tuple(self._parameters[1:]):
                yield script_id

    def _busy(self) -> PinsBusy:
        gpios = " and ".join(map(str, self._pins))
        return PinsBusy(
            f"another program drives GPIO {gpios} through the pigpiod at "
            f"{self._client.address}: end it first"
        )

    def _wait_while(self, script_id: int, status: int, longest_s: float) -> bool:
        end = time.monotonic() + longest_s
        while self._status(script_id)[0] == status:
            if time.monotonic() > end:
                return False
            time.sleep(0.005)
        return True

    def _status(self, script_id: int) -> tuple[int, tuple[int, ...]]:
        status, parameters = self._client.call("script_status", script_id)
        return status, tuple(parameters)


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
        pwm: The GPIOs of the inputs that take a duty.
        pwm_hz: Its frequency.
        by_hardware: Whether all of them have a channel of the PWM hardware. Otherwise the daemon
            times the edges, in steps of 5 us.
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
        # Only once the daemon has accepted it: after a failure it is sent again.
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
            # The script has ended, so its pins are low, whatever was sent before.
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
