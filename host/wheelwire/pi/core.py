"""The loop that steps the firmware's core: reads pins, sets pins, passes bytes. No policy."""

from __future__ import annotations

import hashlib
import select
import time
from contextlib import suppress
from pathlib import Path
from secrets import randbits

from wheelwire_protocol.codes import Chip, ResetReason, SupervisorState
from wheelwire_protocol.core import Core, Identity, Outputs, Sensors
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from ..errors import ConfigurationError
from .gpio.base import Gpio
from .guard import Heartbeat
from .line import Line
from .settings import McuSettings
from .storage import ParameterFile, latch_file

SERVICE_SIZE = 600
"""The most bytes that the core handles in one call of `service`."""
STOPPED_STEPS = 4
"""Consecutive steps with the drive off that mean the end of a stop: fewer come before a brake."""
MACHINE_ID = Path("/etc/machine-id")


def check_board(settings: McuSettings) -> None:
    """The board and its peripherals keep the firmware's rules.

    Raises:
        ConfigurationError: They do not.
    """
    if problems := settings.board.problems():
        raise ConfigurationError("; ".join(problems))


def make_core(
    settings: McuSettings, heartbeat: Heartbeat | None = None, sensors: Sensors | None = None
) -> Core:
    """Create the core with its saved parameters, not started; `heartbeat` beats while it saves.

    Args:
        settings: Settings of the robot.
        heartbeat: See above.
        sensors: Its board's peripherals; None: it does without.

    Raises:
        ConfigurationError: A parameter is refused, or the store cannot be read.
    """
    store = ParameterFile(settings.store, heartbeat or Heartbeat())
    identity = Identity(
        boot_id=randbits(32),
        board=Chip.LINUX,
        board_id=_board_id(),
        reset_reason=ResetReason.POWER_ON,
    )
    core = Core(identity, store.load(), store.save)
    latches = latch_file(settings)
    core.keep_latches(latches.load(), latches.save)
    # Before the presets, which override the defaults that a board gives.
    core.take_board(settings.board.packed())
    if sensors is not None:
        core.sense(sensors)
    # A contact that the board names is fitted; the robot's own parameters may still disable it.
    presets = {"estop_input_enabled": float(settings.board.estop is not None)}
    for name, value in {**presets, **settings.parameters}.items():
        refusal = core.preset(PARAMETER_BY_NAME[name].id, value)
        if refusal:
            raise ConfigurationError(f"parameters.{name} = {value:g}: {refusal.doc}")
    return core


def active_parameters(settings: McuSettings) -> dict[str, float]:
    """All parameters by name, as they are after the start."""
    # A second core, only to look at: the pins have to be opened before the real one may start.
    core = make_core(settings)
    core.start(0, 0, 0)
    return {name: core.value(p.id) for name, p in PARAMETER_BY_NAME.items()}


class McuLoop:
    """Steps a core on opened pins until the process is to end and the core has stopped the wheels.

    Args:
        core: Not started.
        gpio: The pins. The caller closes them.
        line: The line to the application.
        heartbeat: Gets a beat in each pass of the loop.
        endings: File descriptors that become readable when this process is to end.
        start_ns: When the device's clock began, by `time.monotonic_ns`; None: it does now.
    """

    def __init__(
        self,
        core: Core,
        gpio: Gpio,
        line: Line,
        heartbeat: Heartbeat,
        endings: list[int],
        start_ns: int | None = None,
    ) -> None:
        self._core = core
        self._gpio = gpio
        self._line = line
        self._heartbeat = heartbeat
        self._endings = endings
        # The device's clock begins at its start, as a chip's does.
        self._start_ns = time.monotonic_ns() if start_ns is None else start_ns
        self._ending = False
        self._low_steps = 0
        self._outputs = core.start(self._now_us(), *gpio.ticks())
        self._due_us = self._now_us()

    def run(self) -> None:
        """Run until the end. Raises `LinkLost` if the pins can no longer be reached."""
        # Until the process has to end and the core has finished its stop.
        while not (self._ending and self._low_steps >= STOPPED_STEPS):
            ready = self._wait()
            if any(ending in ready for ending in self._endings):
                self._end()
            if data := self._line.receive(ready):
                # Nothing is cut off: the core's queue holds a whole read, and the calls below empty
                # it.
                self._core.feed(data)
                for _ in range(0, len(data), SERVICE_SIZE):  # at least once for any data
                    self._apply(self._core.service(self._now_us()))
            # After what the host sent last, which may be a stop. Its setpoint ends here, not at its
            # deadline: that it is gone is known.
            if self._line.hung_up:
                self._apply(self._core.hang_up(self._now_us()))
                if not self._line.next_host():
                    self._end()
            # In each turn: a host that never pauses must not delay the steps.
            self._step_if_due()
            self._line.send(self._core)
            # Last: a beat confirms a whole pass.
            self._heartbeat.beat()

    def _now_us(self) -> int:
        return (time.monotonic_ns() - self._start_ns) // 1000

    def _end(self) -> None:
        self._ending = True
        # Steps before the end say nothing of the stop that begins below.
        self._low_steps = 0
        self._endings = []  # they stay readable: waiting for them again would not wait
        self._line.close()
        # As if the host had gone: the core stops the wheels the way its parameters say.
        self._apply(self._core.hang_up(self._now_us()))

    def _wait(self) -> list[int]:
        readable, writable = self._line.wait_set()
        wait_s = max(0, self._next_us() - self._now_us()) / 1e6
        found = select.select([*readable, *self._endings], writable, [], wait_s)
        return [*found[0], *found[1]]

    def _next_us(self) -> int:
        """The next step: when it is due, or earlier, at the deadline of the setpoint."""
        if self._outputs.state is SupervisorState.DRIVING:
            return min(self._due_us, self._outputs.deadline_us)
        return self._due_us

    def _step_if_due(self) -> None:
        now_us = self._now_us()
        if now_us < self._next_us():
            return
        gpio = self._gpio
        illegal = gpio.illegal_transitions()
        outputs = self._core.step(
            now_us,
            *gpio.ticks(),
            contact_open=gpio.contact_is_open(),
            left_illegal=illegal.left,
            right_illegal=illegal.right,
            levels=gpio.input_levels(),
        )
        self._apply(outputs)
        # Read from the outputs: how long the core brakes is for its parameters to say.
        self._low_steps = self._low_steps + 1 if self._gpio.is_released(self._outputs) else 0
        # Here and nowhere else: a loop that makes no steps must let the backend's watchdog act.
        self._gpio.keep_alive(now_us)
        # An extra step at a setpoint's deadline does not move the regular ones.
        if now_us >= self._due_us:
            # Counted from the due time, so that delays do not add up; but not into the past, or a
            # long delay would be followed by a burst of steps.
            self._due_us = max(self._due_us + self._outputs.period_us, now_us)

    def _apply(self, outputs: Outputs) -> None:
        self._outputs = outputs
        self._gpio.left.apply(outputs.left)
        self._gpio.right.apply(outputs.right)


def _board_id() -> int:
    """48 bits that identify this computer, the same at each start."""
    # Hashed: machine-id(5) asks not to show the id itself to others.
    with suppress(OSError):
        digest = hashlib.sha256(MACHINE_ID.read_bytes()).digest()
        return int.from_bytes(digest[:6], "big")
    return 0
