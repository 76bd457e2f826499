"""The measurements of `make hil` on a board with the self-test image, as `support.hil` has them."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple, Protocol, TypeVar, cast

from wheelwire_protocol import codes
from wheelwire_protocol import types as wire
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.power_stages import Stage
from wheelwire_protocol.self_test import GROUP, PERMISSION

from . import self_test_types as self_test
from .self_test_wire import Encoder, decoder, message_id

M = TypeVar("M")
Json = dict[str, Any]

FULL = 32767
TTL_S = 0.1
SETPOINT_S = 0.02
ANSWER_S = 0.3
TRIES = 5
DEAD_S = 60.0
"""A board that has not come back by then is reported as dead."""
DUTY = 3000
"""Below stall_duty: wheels that cannot turn are no fault."""
PERIOD_OF_STATES_S = 0.01
FAILS_S = 0.1
"""After the wire.Ack: until then the drive goes on."""
BOX_S = 20.0
"""The box is written once the wheels have stood for a while."""
CHANGES = 10_000
TURNS_AT_LIMIT = 100
EXPIRIES = 100
PINGS = 10_000
SAVES = 20
COUNTER_LIMIT = 32767
EDGE_US = 5
FREQUENCY = PARAMETER_BY_NAME["pwm_frequency_hz"].id
QUIET: dict[str, float] = {
    "stop_mode": 1,
    "stall_duty": 1,
    "stall_time_s": 10,
    "plausibility_time_s": 10,
    "max_duty": 1,
    "max_duty_rate_per_s": 1000,
    "left_motor_inverted": 0,
    "motors_swapped": 0,
}
"""Until the next reset: a stop is the end of the pulses, motors without power are no fault, and
forward is the left stage's."""
ONE_PWM = (Stage.ENABLE_IN1_IN2, Stage.PWM_IN1_IN2, Stage.PWM_DIR)
"""Power stages whose direction has an input of its own, which tells a reversal."""


class BoardError(Exception):
    """The board did not do what was asked; what to do about it."""


class Line(Protocol):
    """A byte stream to the board."""

    def read(self) -> bytes:
        """What has arrived, possibly nothing."""

    def write(self, data: bytes) -> None:
        """Send it."""


class Loop(NamedTuple):
    """One wire from an output of a power stage to an input of an encoder."""

    output: int
    input: int


def parsed_loops(text: str) -> list[Loop]:
    """The wires of `25:18,26:19`. Raises BoardError if it does not read so."""
    wires = [part.split(":") for part in text.split(",") if part]
    if not all(len(ends) == 2 and all(map(str.isdigit, ends)) for ends in wires):
        raise BoardError(f"LOOP={text}: write OUTPUT:INPUT, as 25:18,26:19")
    if len(wires) > 2:
        raise BoardError(f"LOOP={text}: two wires at most, from PWM and direction to A and B")
    return [Loop(*map(int, ends)) for ends in wires]


def suggested_loops(board: wire.ConfigurationValue) -> str:
    """The wires for a board's left wheel, as LOOP takes them."""
    in1, in2 = board.left_in1, board.left_in2
    pwm, direction = {
        Stage.ENABLE_IN1_IN2: (board.left_enable, in1),
        Stage.PWM_IN1_IN2: (board.left_pwm, in1),
        Stage.PWM_DIR: (board.left_pwm, board.left_dir),
    }.get(Stage(board.stage), (in1, in2))
    return f"{pwm}:{board.left_encoder_a},{direction}:{board.left_encoder_b}"


class Board:
    """Sends exactly what a row of the table needs.

    Args:
        line: To the board. It survives a reset of the board.
        now: The host's clock, s.
        sleep: Lets time pass, s.
    """

    def __init__(
        self,
        line: Line,
        now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._line, self.now, self._sleep = line, now, sleep
        self._encoder, self._decoder = Encoder(), decoder()
        self._received: list[Any] = []
        self._session = 0
        self._requests = 0
        self._pings = 0  # Apart: a request far ahead of the newest one counts as an old one.
        self._commands = 0
        self._ahead_us = 0
        self.hello: wire.DeviceHello | None = None
        self.state: wire.WheelState | None = None
        self.duty: tuple[int, int] | None = None
        self.expiry_us = 0
        self.pongs: list[float] = []
        self.acks: list[int] = []
        self._next_setpoint = 0.0

    # --- time and bytes ---

    def device_us(self) -> int:
        """The board's clock."""
        return int(self.now() * 1e6) + self._ahead_us

    def run(self, seconds: float) -> None:
        """Let time pass: keep the drive alive, and collect what the board sends."""
        self.wait(lambda: False, seconds)

    def wait(self, condition: Callable[[], bool], seconds: float) -> bool:
        """As `run`, until the condition holds; whether it does."""
        end = self.now() + seconds
        while not condition() and self.now() < end:
            if self.duty is not None and self.now() >= self._next_setpoint:
                self._next_setpoint = self.now() + SETPOINT_S
                self.command(*self.duty)
            for message in self._decoder.feed(self._line.read()):
                self._take(message)
            self._sleep(0.0005)
        return condition()

    def _take(self, message: Any) -> None:
        if isinstance(message, wire.WheelState):
            self.state = message
        elif isinstance(message, wire.Pong):
            self.pongs.append(self.now())
            self._ahead_us = message.received_us - message.host_us
        elif isinstance(message, wire.Ack):
            self.acks.append(message.request_id)
        self._received.append(message)
        del self._received[:-200]

    def send(self, message: Any) -> None:
        """Put a frame on the line."""
        self._line.write(self._encoder.encode(message))

    def command(self, left: int, right: int) -> None:
        """One setpoint, of duties in 1/32767."""
        self._commands += 1
        self.expiry_us = self.device_us() + int(TTL_S * 1e6)
        self.send(wire.SetDuty(self._session, self._commands, self.expiry_us, left, right))

    def ping(self) -> None:
        """Send one; `pongs` gets the time of its answer."""
        self._pings += 1
        self.send(wire.Ping(self._session, self._pings & 0xFFFF, int(self.now() * 1e6)))

    # --- sessions and requests ---

    def open(self, within_s: float = DEAD_S) -> wire.DeviceHello:
        """Open a session, of a new boot if there was one; wait until the clock is known.

        Raises:
            BoardError: It does not answer, or is of another release.
        """
        self.duty, self.state = None, None
        nonce = random.getrandbits(32)
        end = self.now() + within_s
        while self.now() < end:
            self._received.clear()
            self.send(wire.Hello(nonce, PROTOCOL_VERSION, schema_hash()))
            found: wire.DeviceHello | None = self._next(
                lambda it: isinstance(it, wire.DeviceHello) and it.nonce == nonce, 0.1
            )
            if found is None:
                continue
            if found.refusal != codes.RefusalCode.NONE:
                raise BoardError(codes.RefusalCode(found.refusal).doc)
            self.hello = found
            self._session = nonce ^ found.boot_id
            self._requests = self._pings = self._commands = 0
            self.pongs.clear()
            self.ping()
            self.wait(lambda: bool(self.pongs), 1.0)
            return found
        raise BoardError(f"no answer within {within_s:g} s: press the board's reset button")

    def _next(self, fits: Callable[[Any], bool], seconds: float) -> Any:
        def found() -> Any:
            return next(filter(fits, self._received), None)

        self.wait(lambda: found() is not None, seconds)
        return found()

    def _numbered(self, request: Any) -> Any:
        self._requests = (self._requests + 1) & 0xFFFF
        return request._replace(session_id=self._session, request_id=self._requests)

    def ask(self, request: Any, kind: type[M], seconds: float = ANSWER_S) -> M:
        """Send a request, made with two zeros in front, and return its answer.

        Raises:
            BoardError: The board refused it, or does not answer.
        """
        numbered = self._numbered(request)
        asked, number = message_id(type(request)), numbered.request_id

        def answers(it: Any) -> bool:
            if isinstance(it, wire.Refuse):
                return it.message_id == asked and it.reference == number
            return isinstance(it, kind) and it.request_id == number  # type: ignore[attr-defined]

        for _ in range(TRIES):
            self.send(numbered)
            answer = self._next(answers, seconds)
            if isinstance(answer, wire.Refuse):
                refusal = codes.RefusalCode(answer.code).doc
                raise BoardError(f"the board refused {type(request).__name__}: {refusal}")
            if answer is not None:
                return cast("M", answer)
        raise BoardError(f"no answer to {type(request).__name__}")

    # --- what the rows have in common ---

    def allow(self) -> None:
        """The user has said that the motor supply is off."""
        self.ask(self_test.SelfTestAllow(0, 0, PERMISSION), wire.Ack)

    def get(self, name: str) -> float:
        """An active parameter."""
        asked = wire.ParameterGet(0, 0, PARAMETER_BY_NAME[name].id)
        return self.ask(asked, wire.ParameterValue).value

    def set(self, name: str, value: float) -> None:
        """Set a parameter until the next reset."""
        self.ask(wire.ParameterSet(0, 0, PARAMETER_BY_NAME[name].id, value), wire.ParameterValue)

    def use_frequency(self, frequency_hz: float) -> None:
        """Save a frequency of the PWM, which a restart takes up."""
        self.set("pwm_frequency_hz", frequency_hz)
        self.ask(wire.ParameterSave(0, 0, FREQUENCY), wire.Ack, 1.0)
        self.restart()

    def begin_save(self) -> int:
        """Ask for a save that changes nothing; `acks` gets the number that is returned."""
        # Not of all: QUIET would be saved, too.
        request = self._numbered(wire.ParameterSave(0, 0, FREQUENCY))
        self.send(request)
        return int(request.request_id)

    def ready(self) -> wire.DeviceHello:
        """Open, allow, and clear what holds the robot."""
        hello = self.open()
        self.allow()
        self.wait(lambda: self.state is not None, 1.0)
        if self.state is not None and self.state.supervisor == codes.SupervisorState.ESTOPPED:
            self.ask(wire.ClearEstop(0, 0), wire.Ack)
        if self.state is not None and self.state.supervisor == codes.SupervisorState.FAULT:
            self.ask(wire.ClearFault(0, 0), wire.Ack)
        for name, value in QUIET.items():
            self.set(name, value)
        self.command(0, 0)
        return hello

    def drive(self, left: int, right: int = 0, settle_s: float = 0.0) -> bool:
        """Keep a duty from now on; whether the robot drives."""
        self.duty = (left, right)
        drives = self.wait(self.drives, 2.0)
        self.run(settle_s)
        return drives

    def drives(self) -> bool:
        """Whether it drove when it last said so."""
        return self.state is not None and self.state.supervisor == codes.SupervisorState.DRIVING

    def rest(self) -> None:
        """End the drive."""
        self.duty = (0, 0)
        self.run(TTL_S)
        self.duty = None
        self.wait(lambda: not self.drives(), 2.0)

    def restart(self) -> None:
        """Restart it."""
        self.rest()
        self.ask(wire.Restart(0, 0), wire.Ack)
        self.run(1.0)
        self.ready()

    def configuration(self) -> wire.ConfigurationValue:
        """The board that is active."""
        return self.ask(wire.ConfigurationGet(0, 0), wire.ConfigurationValue)

    @property
    def cores(self) -> list[int]:
        """The cores that the chip has."""
        assert self.hello is not None
        return [0] if self.hello.board == codes.Chip.ESP32C6 else [0, 1]

    def fail_and_return(self, failure: codes.Failure, core: int, delay_us: int) -> Json:
        """Make a core fail while it drives, and wait until the board is back."""
        assert self.hello is not None
        drove = self.drive(DUTY, DUTY, 0.3)
        before = self.hello.boot_id
        self.ask(self_test.SelfTestFail(0, 0, failure, core, delay_us), wire.Ack)
        begin = self.now()
        self.run(FAILS_S)
        event: Json = {"core": core, "drove": drove, "is_back": False}
        while self.now() < begin + DEAD_S:
            try:
                hello = self.open(1.0)
            except BoardError:
                continue
            if hello.boot_id != before:
                event.update(
                    is_back=True,
                    back_s=self.now() - begin,
                    reason=codes.ResetReason(hello.reset_reason).name,
                    has_dump=bool(hello.capabilities & codes.Capability.CORE_DUMP),
                )
                break
        return event


# --- the rows ------------------------------------------------------------------------------------


def measure_crashes(board: Board, times: int) -> Json:
    """Crashes and hangs of each core, while it drives."""
    board.ready()
    events: list[Json] = []
    kinds = [(codes.Failure.CRASH, "crash")] * 5 + [(codes.Failure.HANG, "hang")] * 3
    for _ in range(times):
        for core in board.cores:
            for number, (failure, kind) in enumerate(kinds):
                board.ready()
                event = board.fail_and_return(failure, core, 100 * number)
                events.append({**event, "kind": kind})
                if not event["is_back"]:
                    return {"events": events, "times_release": False}
    board.ready()
    board.run(BOX_S)
    box = board.ask(wire.BoxGet(0, 0, 0), wire.BoxValue)
    return {
        "events": events,
        "times_release": False,
        "box_reason": codes.ResetReason(box.reset_reason).name,
        "box_is_of_reset": box.cause == codes.BoxCause.RESET,
    }


def _watch(board: Board, loops: list[Loop], core: int = 0) -> self_test.SelfTestReport:
    watch = self_test.SelfTestWatch(0, 0, loops[0].input, loops[-1].input, core)
    return board.ask(watch, self_test.SelfTestReport)


def begin_watch(board: Board, loops: list[Loop], core: int = 0) -> None:
    """Raises BoardError if the board cannot measure the edges."""
    _watch(board, loops, core)
    board.run(0.1)
    if _watch(board, loops, core).resolution_hz == 0:
        raise BoardError(
            "the board cannot measure: its capture unit is in use; "
            "take range sensors out of its configuration"
        )


def _pulses(board: Board, loops: list[Loop], seconds: float) -> self_test.SelfTestReport:
    _watch(board, loops)
    board.run(seconds)
    return _watch(board, loops)


def measure_duties(board: Board, loops: list[Loop], frequency_hz: int) -> Json:
    """Period and high time of constant duties."""
    period = 0.0
    worst = edges = 0.0
    started = True
    pwm_hz = 80e6 if frequency_hz >= 1221 else 5e6
    period_ticks = pwm_hz // frequency_hz
    for part in (10 / period_ticks, 0.5, 0.99, 1.0, 0.0):
        duty = round(part * FULL)
        board.drive(duty, 0, 0.2)
        seen = _pulses(board, loops, 0.1)
        if duty in (0, FULL):
            edges += seen.rises + seen.falls
            continue
        started = started and seen.rises > 0
        tick = seen.resolution_hz / pwm_hz
        wanted = duty * period_ticks // FULL
        worst = max(worst, *(abs(it / tick - wanted) for it in (seen.least_high, seen.most_high)))
        if part == 0.5:
            period = (seen.least_period + seen.most_period) / 2 / seen.resolution_hz
    board.rest()
    return {
        "frequency_hz": frequency_hz,
        "period_us": period * 1e6,
        "started": started,
        "worst_ticks": worst,
        "edges_of_levels": edges,
    }


def measure_changes(board: Board, loops: list[Loop], frequency_hz: int, changes: int) -> Json:
    """Changes of duty in one direction: how often a pulse is longer than the larger duty."""
    draw = random.Random(frequency_hz)
    wrong, before = 0, 0
    board.drive(1000, 0, 0.2)
    for _ in range(changes // 10):
        batch = [draw.randrange(1000, 32000) for _ in range(10)]
        _watch(board, loops)
        for duty in batch:
            board.duty = None
            board.command(duty, 0)
            board.run(0.004)
        board.duty = (batch[-1], 0)
        seen = _watch(board, loops)
        most = max(before, *batch) / FULL / frequency_hz
        wrong += seen.most_high > most * seen.resolution_hz * 1.01 + 2
        before = batch[-1]
    board.rest()
    return {"frequency_hz": frequency_hz, "changes": changes, "wrong": wrong}


def measure_reversals(board: Board, loops: list[Loop], frequency_hz: int, count: int) -> Json:
    """From nearly full to little, the other way round, and back: the longest pulse backward.

    Once it goes forward again, there must be none.
    """
    much, little = 30_000, 3_000
    most = wrong_way = 0.0
    drives = True

    def backward(seen: self_test.SelfTestReport) -> float:
        return seen.most_high_other / seen.resolution_hz * frequency_hz

    for _ in range(count):
        board.drive(much, 0, 0.1)
        wrong_way = max(wrong_way, backward(_pulses(board, loops, 0.05)))
        _watch(board, loops)
        board.drive(-little, 0, 0.1)
        most = max(most, backward(_watch(board, loops)))
        drives = drives and _pulses(board, loops, 0.05).rises > 0
    board.rest()
    return {
        "frequency_hz": frequency_hz,
        "reversals": count,
        "wanted_part": little / FULL,
        "most_part": most,
        "wrong_way_part": wrong_way,
        "drives_afterwards": drives,
    }


def measure_pwm(board: Board, loops: list[Loop], times: int) -> Json:
    """The row `pwm`. The board's own frequency is saved again at its end."""
    board.ready()
    can_reverse = len(loops) > 1 and board.configuration().stage in ONE_PWM
    found: Json = {"duties": [], "changes": [], "reversals": [] if can_reverse else None}
    saved = board.get("pwm_frequency_hz")
    try:
        for frequency_hz in (20_000, 500):
            board.use_frequency(frequency_hz)
            begin_watch(board, loops)
            found["duties"].append(measure_duties(board, loops, frequency_hz))
            found["changes"].append(measure_changes(board, loops, frequency_hz, CHANGES * times))
            if can_reverse:
                found["reversals"].append(measure_reversals(board, loops, frequency_hz, 20 * times))
    finally:
        try:
            board.use_frequency(saved)
        except BoardError as error:
            raise BoardError(
                f"{error}; one of this test's PWM frequencies may be saved: when the board is "
                f"back, save pwm_frequency_hz = {saved:g} again"
            ) from error
    return found


def turn(board: Board, loops: list[Loop], edges: int, spikes: int = 0) -> int:
    """Play an encoder; how many ticks the board counted, whichever way is forward."""

    def ticks() -> int:
        board.run(5 * PERIOD_OF_STATES_S)
        assert board.state is not None
        return board.state.left_ticks - board.state.right_ticks

    before = ticks()
    pins = (loops[0].output, loops[1].output)
    board.ask(self_test.SelfTestTurn(0, 0, *pins, edges, EDGE_US, spikes), wire.Ack)
    board.run(3e-6 * EDGE_US * abs(edges) + 1e-4 * spikes)
    while _watch(board, loops).turns:
        board.run(0.05)
    return abs(ticks() - before)


def measure_counters(board: Board, loops: list[Loop], times: int) -> Json:
    """The row `counters`. The counter's limit is where it is only after a restart."""
    board.ready()
    board.restart()
    to_limit = COUNTER_LIMIT // 4 * 4
    error_at_limit = turn(board, loops, to_limit) - to_limit
    for number in range(2 * TURNS_AT_LIMIT * times):
        error_at_limit += turn(board, loops, 8 if number % 2 == 0 else -8) - 8
    error = 0
    for edges in [100_000, -200_000, 100_000] * times:
        error += abs(turn(board, loops, edges) - abs(edges))
    spikes = 100 * times
    return {
        "started": True,
        "error_ticks": error,
        "turns_at_limit": TURNS_AT_LIMIT * times,
        "error_at_limit_ticks": error_at_limit,
        "spikes": spikes,
        "error_of_spikes_ticks": turn(board, loops, 0, spikes) - spikes,
    }


def measure_stops(board: Board, loops: list[Loop], times: int) -> Json:
    """The row `stops`: setpoints that expire, cores that freeze."""
    board.ready()
    begin_watch(board, loops)
    longest = 0.0
    for number in range(EXPIRIES * times):
        board.drive(DUTY, DUTY, 0.05 + 1e-4 * (number % 10))
        board.duty = None
        board.wait(lambda: board.state is not None and not board.drives(), 2.0)
        late_us = _watch(board, loops).last_fall_us - board.expiry_us
        longest = max(longest, late_us / 1e3)
    freezes: list[Json] | None = [] if len(board.cores) > 1 else None
    if freezes is not None:  # The other core times it.
        for number in range(5 * times):
            for core in board.cores:
                board.ready()
                begin_watch(board, loops, 1 - core)
                event = board.fail_and_return(codes.Failure.FREEZE, core, 200 * (number % 5))
                if event["is_back"]:
                    board.allow()
                    last = board.ask(self_test.SelfTestLastGet(0, 0), self_test.SelfTestLast)
                    event["released_ms"] = (last.last_fall_us - last.failed_us) / 1e3
                freezes.append(event)
    return {"expiries": {"count": EXPIRIES * times, "longest_ms": longest}, "freezes": freezes}


def measure_line(board: Board, times: int) -> Json:
    """The row `line`: pings at rest, and saves with pings meanwhile."""
    hello = board.ready()
    pings, saves = PINGS * times, SAVES * times
    board.pongs.clear()
    for _ in range(pings):
        board.ping()
        board.run(0.002)
    board.run(0.1)
    lost = pings - len(board.pongs)
    saved, longest = 0, 0.0
    for _ in range(saves):
        board.pongs.clear()
        board.acks.clear()
        begin = board.now()
        request = board.begin_save()
        while board.now() < begin + 1.0:
            board.ping()
            board.run(0.01)
        moments = [begin, *board.pongs]
        longest = max(longest, *(b - a for a, b in pairwise(moments)))
        saved += request in board.acks
    return {
        "pings": pings,
        "lost": lost,
        "saves": saves,
        "saved": saved,
        "longest_pause_ms": longest * 1e3,
        "resets": int(board.open().boot_id != hello.boot_id),
    }


def measure(board: Board, loops: list[Loop], times: int) -> Json:
    """All rows that the wires allow."""
    found: Json = {"crashes": measure_crashes(board, times)}
    if not all(event["is_back"] for event in found["crashes"]["events"]):
        return found
    if loops:
        found["pwm"] = measure_pwm(board, loops, times)
    if len(loops) > 1:
        found["counters"] = measure_counters(board, loops, times)
    if loops:
        found["stops"] = measure_stops(board, loops, times)
    found["line"] = measure_line(board, times)
    return found


def has_self_test(board: Board) -> bool:
    """Whether it has the self-test image."""
    return board.ask(wire.GroupGet(0, 0, GROUP), wire.GroupInfo).hash == self_test.HASH


def check_confirmed(board: Board) -> None:
    """Raises BoardError unless the board that is active was confirmed."""
    if board.configuration().state != codes.ConfigurationState.STORED:
        raise BoardError(
            "nobody has confirmed this board, so nothing drives: run wheelwire board confirm"
        )
