"""A fake device: the whole protocol, but no motors and no control. Sans-IO."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, field
from random import Random

from wheelwire_protocol.codec import PROTOCOL_VERSION, message_id, schema_hash
from wheelwire_protocol.codes import (
    Board,
    RefusalCode,
    SupervisorEvent,
    SupervisorState,
    TrialAction,
)
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Counters, Encoder
from wheelwire_protocol.parameters import (
    PARAMETER_BY_ID,
    PARAMETER_BY_NAME,
    PARAMETERS,
    Changes,
    Kind,
)
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    ClearEstop,
    ClearFault,
    Contradictions,
    ContradictionsGet,
    ControlCounters,
    ControlCountersGet,
    DeviceHello,
    Estop,
    Event,
    Hello,
    LinkCounters,
    LinkCountersGet,
    ParameterEntry,
    ParameterGet,
    ParameterList,
    ParameterReset,
    ParameterSave,
    ParameterSet,
    ParameterTrial,
    ParameterValue,
    Ping,
    Pong,
    Refuse,
    SetDuty,
    SetStreamRate,
    SetWheelVelocity,
    Stop,
    WheelState,
)

CACHE = 4
MASK_32 = (1 << 32) - 1
Request = (
    ClearEstop
    | ClearFault
    | SetStreamRate
    | ParameterGet
    | ParameterSet
    | ParameterSave
    | ParameterReset
    | ParameterList
    | ParameterTrial
    | LinkCountersGet
    | ControlCountersGet
    | ContradictionsGet
)


@dataclass
class FakeDevice:
    """Answers a host as SPEC.md specifies.

    `received` has every message that arrived intact, `done` every request carried out, `obeyed`
    every setpoint obeyed.
    """

    random: Random = field(default_factory=lambda: Random(1))
    clock_offset_us: int = 5_000_000
    drift: float = 0.0
    rate_hz: int = 100
    protocol_version: int = PROTOCOL_VERSION
    schema_hash: int = field(default_factory=schema_hash)
    mute: bool = False
    booting: bool = False
    ticks_per_state: tuple[int, int] = (3, 2)
    board: Board = Board.SIMULATED
    wheel_mps: float = 0.1
    board_id: int = 0x240AC4123456
    ttl_max_s: float = float(PARAMETER_BY_NAME["ttl_max_s"].default)

    def __post_init__(self) -> None:
        self.received: list[AnyMessage] = []
        self.done: list[AnyMessage] = []
        self.obeyed: list[SetWheelVelocity | SetDuty] = []
        self.lost_answers: set[type[AnyMessage]] = set()
        """Number of requests to carry out without sending the answer."""
        self.supervisor = SupervisorState.IDLE
        self.parameters = {p.id: float(p.default) for p in PARAMETERS}
        self.parameters[PARAMETER_BY_NAME["ttl_max_s"].id] = self.ttl_max_s
        self._next_state_us = 0
        self._start()

    def _start(self) -> None:
        self.boot_id = self.random.getrandbits(32)
        self.left_ticks = self.right_ticks = 0
        self.supervisor = SupervisorState.IDLE
        self._decoder = Decoder()
        self._encoder = Encoder()
        self._output = bytearray()
        self._nonce: int | None = None
        self._newest_request = 0
        self._cache: OrderedDict[int, AnyMessage] = OrderedDict()
        self._synchronised = False
        self._newest_command = self._command_seq = 0
        self._deadline_us = 0
        self._unarmed = False
        self._quiet_since_us = 0
        self.former: dict[int, float] | None = None
        """Before the trial that runs."""

    def reset(self) -> None:
        """Reset the chip: a new boot id, everything else is lost."""
        self._start()

    @property
    def session_id(self) -> int:
        return -1 if self._nonce is None else self._nonce ^ self.boot_id

    @property
    def next_us(self) -> int:
        """When `advance` may have something to do next."""
        return self._next_state_us

    @property
    def counters(self) -> Counters:
        """Counters of what has arrived since the reset."""
        return self._decoder.counters

    def clock(self, now_us: int) -> int:
        return round(now_us * (1 + self.drift)) + self.clock_offset_us

    def feed(self, data: bytes, now_us: int) -> None:
        """Receive bytes from the line."""
        for message in self._decoder.feed(data):
            self.received.append(message)
            if not self.mute:
                self._handle(message, now_us)

    def take_output(self) -> bytes:
        output = bytes(self._output)
        self._output.clear()
        return output

    def advance(self, now_us: int) -> None:
        """Send a state frame when one is due; let the setpoint's deadline act."""
        if self.supervisor is SupervisorState.DRIVING and self.clock(now_us) >= self._deadline_us:
            self.move_to(SupervisorState.TIMED_OUT, SupervisorEvent.DEADLINE, now_us)
        if self._nonce is None or self.mute or not self.rate_hz or now_us < self._next_state_us:
            return
        self._next_state_us = now_us + 1_000_000 // self.rate_hz
        self.left_ticks += self.ticks_per_state[0]
        self.right_ticks += self.ticks_per_state[1]
        self.send(self.state(now_us))

    def state(self, now_us: int) -> WheelState:
        return WheelState(
            boot_id=self.boot_id,
            t_us=self.clock(now_us) & MASK_32,
            left_ticks=_signed(self.left_ticks),
            right_ticks=_signed(self.right_ticks),
            left_mps=self.wheel_mps,
            right_mps=self.wheel_mps,
            left_duty_q15=16384,
            right_duty_q15=-16384,
            command_seq=self._command_seq,
            supervisor=self.supervisor,
            faults=0,
            overruns=0,
            battery_mv=0,
        )

    def move_to(self, state: SupervisorState, cause: SupervisorEvent, now_us: int) -> None:
        """A transition of the supervisor, with its event."""
        before, self.supervisor = self.supervisor, state
        t_us = self.clock(now_us) & MASK_32
        if self._nonce is not None:
            self.send(Event(self.boot_id, t_us, 0, cause, before, state, 0, 0.0))

    def send(self, message: AnyMessage) -> None:
        self._output += self._encoder.encode(message)

    # --- messages ------------------------------------------------------------------------------

    def _handle(self, message: AnyMessage, now_us: int) -> None:
        if isinstance(message, Hello):
            self._greet(message, now_us)
        elif isinstance(message, Stop):
            if message.session_id == self.session_id:
                self._newest_command = max(self._newest_command, message.command_seq)
            if self.supervisor in (SupervisorState.DRIVING, SupervisorState.TIMED_OUT):
                self.move_to(SupervisorState.IDLE, SupervisorEvent.STOP, now_us)
            self.send(Ack(message.session_id, message.request_id, message_id(Stop)))
        elif isinstance(message, Estop):
            self.move_to(SupervisorState.ESTOPPED, SupervisorEvent.ESTOP, now_us)
            self.send(Ack(message.session_id, message.request_id, message_id(Estop)))
        elif isinstance(message, (SetWheelVelocity, SetDuty)):
            self._on_setpoint(message, now_us)
        elif isinstance(message, Ping):
            self._on_ping(message, now_us)
        elif isinstance(message, Request):
            self._on_request(message, now_us)

    def _greet(self, hello: Hello, now_us: int) -> None:
        refusal = RefusalCode.NONE
        if hello.protocol_version != self.protocol_version:
            refusal = RefusalCode.PROTOCOL_VERSION
        elif hello.schema_hash != self.schema_hash:
            refusal = RefusalCode.SCHEMA
        elif self.booting:
            refusal = RefusalCode.BOOTING
        elif hello.nonce != self._nonce:
            self._nonce = hello.nonce
            self._newest_request = self._newest_command = self._command_seq = 0
            self._cache.clear()
            self._revert()
            self._synchronised = False
            if self.supervisor in (SupervisorState.DRIVING, SupervisorState.TIMED_OUT):
                self.supervisor = SupervisorState.IDLE
        self.send(
            DeviceHello(
                nonce=hello.nonce,
                protocol_version=self.protocol_version,
                schema_hash=self.schema_hash,
                refusal=refusal,
                boot_id=self.boot_id,
                device_us=self.clock(now_us),
                reset_reason=1,
                board=self.board,
                board_id=self.board_id,
                capabilities=4,
                version_major=9,
                version_minor=8,
                version_patch=7,
                git_hash=0xDEADBEEF,
            )
        )

    def _on_ping(self, ping: Ping, now_us: int) -> None:
        if ping.session_id != self.session_id:
            self._refuse(ping, RefusalCode.NO_SESSION, ping.request_id)
            return
        self._synchronised = True
        device_us = self.clock(now_us)
        self.send(Pong(ping.session_id, ping.request_id, ping.host_us, device_us, device_us))

    def _on_setpoint(self, setpoint: SetWheelVelocity | SetDuty, now_us: int) -> None:
        if setpoint.session_id != self.session_id:
            self._refuse(setpoint, RefusalCode.NO_SESSION, setpoint.command_seq)
        elif setpoint.command_seq > self._newest_command:
            self._newest_command = setpoint.command_seq
            refusal = self._setpoint_refusal(setpoint, now_us)
            if refusal is not None:
                self._refuse(setpoint, refusal, setpoint.command_seq)
                return
            self._command_seq = setpoint.command_seq
            self._deadline_us = setpoint.expiry_us
            self.obeyed.append(setpoint)
            if self.supervisor is not SupervisorState.DRIVING:
                self.move_to(SupervisorState.DRIVING, SupervisorEvent.SETPOINT, now_us)

    def _setpoint_refusal(
        self, setpoint: SetWheelVelocity | SetDuty, now_us: int
    ) -> RefusalCode | None:
        if not all(map(math.isfinite, setpoint)):
            return RefusalCode.NOT_FINITE
        if not self._synchronised:
            return RefusalCode.CLOCK_UNSYNCHRONISED
        gap_us = self.parameters[PARAMETER_BY_NAME["rearm_gap_s"].id] * 1e6
        after_gap = now_us - self._quiet_since_us >= gap_us
        self._quiet_since_us = now_us
        if setpoint.expiry_us <= self.clock(now_us):
            return RefusalCode.EXPIRED
        latched = {
            SupervisorState.ESTOPPED: RefusalCode.ESTOPPED,
            SupervisorState.FAULT: RefusalCode.FAULT,
        }
        if self.supervisor in latched:
            return latched[self.supervisor]
        if self._unarmed and any(setpoint[-2:]) and not after_gap:
            return RefusalCode.UNARMED
        self._unarmed = False
        return None

    def _on_request(self, request: Request, now_us: int) -> None:
        if request.session_id != self.session_id:
            self._refuse(request, RefusalCode.NO_SESSION, request.request_id)
            return
        cached = self._cache.get(request.request_id)
        if cached is not None:
            self._answer(request, cached)
            return
        if not 0 < (request.request_id - self._newest_request) % (1 << 16) < 1 << 15:
            return
        self._newest_request = request.request_id
        answer = self._try(request) if isinstance(request, ParameterTrial) else self._do(request)
        if isinstance(request, (ClearEstop, ClearFault)):
            self._quiet_since_us = now_us
        self._cache[request.request_id] = answer
        while len(self._cache) > CACHE:
            self._cache.popitem(last=False)
        self._answer(request, answer)

    def _answer(self, request: Request, answer: AnyMessage) -> None:
        if type(request) not in self.lost_answers:
            self.send(answer)

    def _do(self, request: Request) -> AnyMessage:
        self.done.append(request)
        head = (request.session_id, request.request_id)
        if isinstance(request, ParameterSet):
            code = self._parameter_refusal(request)
            if code is not None:
                return Refuse(head[0], message_id(ParameterSet), code, head[1])
            self.parameters[request.parameter] = request.value
        if isinstance(request, (ParameterGet, ParameterSet)):
            return ParameterValue(*head, request.parameter, self.parameters[request.parameter])
        if isinstance(request, ParameterList):
            p = PARAMETERS[request.parameter_index]
            bounds = (p.default, p.minimum, p.maximum)
            count = len(PARAMETERS)
            return ParameterEntry(
                *head, request.parameter_index, count, p.id, self.parameters[p.id], *bounds
            )
        if isinstance(request, LinkCountersGet):
            c = self._decoder.counters
            damage = (c.bad_crc, c.bad_cobs, c.unknown_id, c.wrong_length, c.seq_lost)
            return LinkCounters(*head, c.frames, 0, *damage, 0, 0, 0)
        if isinstance(request, (ContradictionsGet, ControlCountersGet)):
            contradicts = isinstance(request, ContradictionsGet)
            return Contradictions(*head, 0, 0) if contradicts else ControlCounters(*head, *[0] * 5)
        if isinstance(request, ParameterReset):
            self.parameters = {p.id: float(p.default) for p in PARAMETERS}
        elif isinstance(request, SetStreamRate):
            self.rate_hz = request.rate_hz
        elif isinstance(request, (ClearEstop, ClearFault)):
            latched = (SupervisorState.ESTOPPED, SupervisorState.FAULT)
            self._unarmed |= self.supervisor in latched
            self.supervisor = SupervisorState.IDLE
        return Ack(*head, message_id(type(request)))

    def _try(self, request: ParameterTrial) -> AnyMessage:
        """Trials without a deadline: a test ends them by a new session."""
        self.done.append(request)
        head = (request.session_id, request.request_id)
        begins = request.action == TrialAction.BEGIN
        if request.action != TrialAction.REVERT and begins is (self.former is not None):
            code = RefusalCode.ON_TRIAL if begins else RefusalCode.NO_TRIAL
            return Refuse(head[0], message_id(ParameterTrial), code, head[1])
        if begins:
            self.former = dict(self.parameters)
        elif request.action == TrialAction.KEEP:
            self.former = None
        elif request.action == TrialAction.REVERT:
            self._revert()
        return Ack(*head, message_id(ParameterTrial))

    def _revert(self) -> None:
        if self.former is not None:
            self.parameters = self.former
        self.former = None

    def _parameter_refusal(self, request: ParameterSet) -> RefusalCode | None:
        parameter = PARAMETER_BY_ID.get(request.parameter)
        if parameter is None:
            return RefusalCode.UNKNOWN_PARAMETER
        if not math.isfinite(request.value):
            return RefusalCode.NOT_FINITE
        if not parameter.minimum - 1e-6 <= request.value <= parameter.maximum + 1e-6:
            return RefusalCode.OUT_OF_RANGE
        if parameter.kind is not Kind.REAL and not request.value.is_integer():
            return RefusalCode.NOT_INTEGRAL
        fixed = {
            SupervisorState.DRIVING: (Changes.STOPPED, Changes.RELEASED),
            SupervisorState.ESTOPPED: (Changes.RELEASED,),
        }
        changes = request.value != self.parameters[request.parameter]
        if changes and parameter.changes in fixed.get(self.supervisor, ()):
            return RefusalCode.NOT_STOPPED
        return None

    def _refuse(
        self,
        message: Request | Ping | SetWheelVelocity | SetDuty,
        code: RefusalCode,
        reference: int,
    ) -> None:
        self.send(Refuse(message.session_id, message_id(type(message)), code, reference))


def _signed(value: int) -> int:
    half = 1 << 31
    return (value + half) % (1 << 32) - half
