"""The firmware's core at the far end of a line, and what a test changes of its answers. Sans-IO."""

from __future__ import annotations

import math
import threading
from random import Random
from typing import Any, TypeVar

from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import Chip, RefusalCode, ResetReason, SupervisorState
from wheelwire_protocol.core import Core, Identity, Outputs, StageInputs
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Counters, Encoder
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import (
    AnyMessage,
    DeviceHello,
    Estop,
    Refuse,
    SetDuty,
    SetWheelVelocity,
    WheelState,
)

BOARD_ID = 0x240AC4123456
SETPOINTS = message_id(SetWheelVelocity), message_id(SetDuty)
UNHURRIED: dict[str, Any] = {"control_rate_hz": 100.0, "overrun_limit_us": 100_000.0}
"""Parameters of a device with few control steps: most of what a test with many seconds computes."""
Edits = dict[type[Any], dict[str, Any]]
M = TypeVar("M")


class CoreDevice:
    """A robot whose wheels turn as fast as their duty says: at full duty, `full_speed_tps`.

    Its time is the host's, with an offset and `drift`; it passes in `feed` and `advance`. They may
    be called by another thread than `reset`.

    Attributes:
        parameters: Defaults by name, from the next reset on.
        clock_offset_us: From the host's clock.
        mute: It receives nothing and sends nothing by itself.
        lost: Types of messages that are lost on their way to the host, or whose answer is.
        edits: By type of message, the fields that are sent with other values.
        received: What has arrived intact, also while mute.
        obeyed: Every setpoint that was obeyed.
    """

    def __init__(
        self,
        *,
        seed: int = 1,
        drift: float = 0.0,
        board: Chip = Chip.SIMULATED,
        board_id: int = BOARD_ID,
        edits: Edits | None = None,
        **parameters: float,
    ) -> None:
        self._random = Random(seed)
        self._drift = drift
        self.board = board
        self.clock_offset_us = 5_000_000
        self.full_speed_tps = 1200.0
        self.board_id = board_id
        self.mute = False
        self.parameters = parameters
        self.lost: set[type[AnyMessage]] = set()
        self.edits: Edits = edits or {}
        self.received: list[AnyMessage] = []
        self.obeyed: list[SetWheelVelocity | SetDuty] = []
        self.left_ticks = self.right_ticks = 0.0
        self._stored = b""
        self._lock = threading.RLock()
        self.reset()

    def reset(self) -> None:
        """Reset the chip: a new boot id; all but the saved parameters is lost."""
        with self._lock:
            self.boot_id = self._random.getrandbits(32)
            self.left_ticks = self.right_ticks = 0.0
            identity = Identity(self.boot_id, self.board, self.board_id, ResetReason.POWER_ON)
            self.core = Core(identity, self._stored, self._save)
            for name, value in self.parameters.items():
                assert self.core.preset(PARAMETER_BY_NAME[name].id, value) is RefusalCode.NONE
            self.session_id = -1
            self._state: WheelState | None = None
            self._outputs: Outputs | None = None
            self._next_us = 0
            self._decoder = Decoder()
            self._sent = Decoder()
            self._encoder = Encoder()
            self._output = bytearray()
            self._requests: dict[int, type[AnyMessage]] = {}
            self._seen: set[AnyMessage] = set()

    def _save(self, block: bytes) -> bool:
        self._stored = block
        return True

    @property
    def supervisor(self) -> SupervisorState:
        return self._outputs.state if self._outputs else SupervisorState.BOOT

    @property
    def counters(self) -> Counters:
        """Counters of what has arrived since the reset."""
        return self._decoder.counters

    @property
    def state(self) -> WheelState:
        """The newest state frame of this boot, whether it was lost or not."""
        assert self._state is not None
        return self._state

    def asked(self, kind: type[M]) -> list[M]:
        """The messages of one type that have arrived, without their copies."""
        return list(dict.fromkeys(m for m in self.received if isinstance(m, kind)))

    def forget(self) -> None:
        """What has arrived until now, such as what a host sends when it opens the robot."""
        self.received.clear()
        self.obeyed.clear()

    def count(self, *kinds: type[AnyMessage]) -> int:
        """How many messages of these types have arrived, copies included."""
        return sum(isinstance(message, kinds) for message in self.received)

    def clock(self, now_us: int) -> int:
        """Its own time."""
        return round(now_us * (1 + self._drift)) + self.clock_offset_us

    @property
    def next_us(self) -> int:
        """When its next control step is due, by the host's clock."""
        return math.ceil((self._next_us - self.clock_offset_us) / (1 + self._drift))

    def value(self, name: str) -> float:
        """A parameter's value."""
        return self.core.value(PARAMETER_BY_NAME[name].id)

    def feed(self, data: bytes, now_us: int) -> None:
        """Receive bytes from the line; they are answered at once."""
        with self._lock:
            self.advance(now_us)
            messages = self._decoder.feed(data)
            self.received += messages
            if self.mute:
                return
            self._requests |= {getattr(m, "request_id", 0): type(m) for m in messages}
            self.core.feed(data)
            refused = self._service(now_us)
            setpoints = [m for m in messages if isinstance(m, (SetWheelVelocity, SetDuty))]
            new = [m for m in setpoints if m not in self._seen]
            self._seen.update(new)
            self.obeyed += [m for m in new if m.command_seq not in refused]

    def estop(self, now_us: int) -> None:
        """Another host asks for an e-stop."""
        with self._lock:
            self.core.feed(Encoder().encode(Estop(0, 0)))
            self._service(now_us)

    def advance(self, now_us: int) -> None:
        """Let time pass: the control steps that are due until then."""
        with self._lock:
            due_us = self.clock(now_us)
            if self._outputs is None:
                self._step(self.core.start(due_us, *self._ticks()), due_us)
            while self._next_us <= due_us:
                assert self._outputs is not None
                period_s = self._outputs.period_us / 1e6
                self.left_ticks += _duty(self._outputs.left) * self.full_speed_tps * period_s
                self.right_ticks += _duty(self._outputs.right) * self.full_speed_tps * period_s
                self._step(self.core.step(self._next_us, *self._ticks()), self._next_us)

    def send(self, message: AnyMessage) -> None:
        """Put a message on the line that is not the core's."""
        self._output += self._encoder.encode(message)

    def take_output(self) -> bytes:
        output = bytes(self._output)
        self._output.clear()
        return output

    def _ticks(self) -> tuple[int, int]:
        return int(self.left_ticks), int(self.right_ticks)

    def _step(self, outputs: Outputs, now_us: int) -> None:
        self._outputs = outputs
        self._next_us = now_us + outputs.period_us
        self._collect()

    def _service(self, now_us: int) -> set[int]:
        outputs = self.core.service(self.clock(now_us))
        if self._outputs is not None:
            self._outputs = outputs
        return self._collect()

    def _collect(self) -> set[int]:
        """Take what the core sends; the numbers of the setpoints that it refuses."""
        refused: set[int] = set()
        sent = self.core.take()
        if not sent:
            return refused
        for message in self._sent.feed(sent):
            if isinstance(message, Refuse) and message.message_id in SETPOINTS:
                refused.add(message.reference)
            elif isinstance(message, WheelState):
                self._state = message
            elif isinstance(message, DeviceHello) and message.refusal == RefusalCode.NONE:
                self.session_id = message.nonce ^ message.boot_id
            asked = self._requests.get(getattr(message, "request_id", 0))
            if not self.mute and not self.lost & {type(message), asked}:
                self.send(message._replace(**self.edits.get(type(message), {})))
        return refused


def _duty(stage: StageInputs) -> float:
    """Duty at an L298N's inputs; the core drives one where no board is named."""
    return ((stage.in1_q15 > 0) - (stage.in2_q15 > 0)) * stage.enable_q15 / 32767
