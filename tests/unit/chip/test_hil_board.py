"""`make hil` on a board: what it asks, what it measures, and what it makes of the answers.

The board is made up: it has the firmware's timing in a few lines, and one fault at a time.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hardware import board as command
from support import hil, hil_board
from support.hil_board import Board, BoardError, Loop
from support.self_test_types import (
    HASH,
    SelfTestAllow,
    SelfTestFail,
    SelfTestLast,
    SelfTestLastGet,
    SelfTestReport,
    SelfTestTurn,
    SelfTestWatch,
)
from support.self_test_wire import Encoder, decoder
from wheelwire_protocol.codec import BY_TYPE, schema_hash
from wheelwire_protocol.codes import (
    BoxCause,
    Capability,
    Chip,
    ConfigurationState,
    Failure,
    RefusalCode,
    ResetReason,
    SupervisorState,
)
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, PARAMETERS
from wheelwire_protocol.power_stages import Stage
from wheelwire_protocol.self_test import GROUP, PERMISSION
from wheelwire_protocol.types import (
    Ack,
    BoxGet,
    BoxValue,
    ConfigurationGet,
    ConfigurationValue,
    DeviceHello,
    GroupGet,
    GroupInfo,
    Hello,
    ParameterGet,
    ParameterSave,
    ParameterSet,
    ParameterValue,
    Ping,
    Pong,
    Refuse,
    Restart,
    SetDuty,
    WheelState,
)

_CODEC = BY_TYPE[ConfigurationValue]
BOARD = ConfigurationValue(*_CODEC.unpack(bytes(_CODEC.size)))._replace(
    left_enable=25, left_in1=26, left_in2=27, left_encoder_a=18, left_encoder_b=19
)
LOOPS = [Loop(25, 18), Loop(26, 19)]
CAPTURE_HZ = 80_000_000
BOOT_S = 0.4
STEP_S = 0.001
REASONS = {
    Failure.CRASH: ResetReason.PANIC,
    Failure.HANG: ResetReason.TASK_WATCHDOG,
    Failure.FREEZE: ResetReason.INTERRUPT_WATCHDOG,
}


class MadeUpBoard:
    """A board in virtual time, at the other end of a line."""

    def __init__(self, chip: Chip = Chip.ESP32) -> None:
        self.t = 0.0
        self.chip = chip
        self.stage = Stage.ENABLE_IN1_IN2
        self.fault = ""
        self.saved = {parameter.id: parameter.default for parameter in PARAMETERS}
        self.saves = 0
        self.last = (Failure.NONE, 0, 0, 0)
        self.reason = ResetReason.POWER_ON
        self.boot_id = 0
        self.asked: list[Any] = []
        self._decoder, self._encoder = decoder(), Encoder()
        self._start()

    def _start(self) -> None:
        self.boot_id += 1
        self.started = self.t + BOOT_S
        self.values = dict(self.saved)
        self.allowed = self.watches = False
        self.session = 0
        self.duty, self.duty_t, self.expiry_us = 0, 0.0, 0
        self.pulses: list[tuple[int, bool]] = []
        self.fell_us = 0
        self.ticks = 0
        self.pending: tuple[float, SelfTestFail] | None = None
        self._out = b""
        self._next_state = self.started

    # --- a line, and time ---

    def now(self) -> float:
        return self.t

    def sleep(self, seconds: float) -> None:
        self.t += max(seconds, STEP_S)
        self._pass()

    @property
    def us(self) -> int:
        return int((self.t - self.started) * 1e6)

    def read(self) -> bytes:
        sent, self._out = self._out, b""
        return sent

    def write(self, data: bytes) -> None:
        for message in self._decoder.feed(data):
            if self.t >= self.started and self.fault != "dead":
                self._serve(message)

    def _send(self, message: Any) -> None:
        self._out += self._encoder.encode(message)

    def _pass(self) -> None:
        if self.pending is not None and self.t >= self.pending[0]:
            self._fail(self.pending[1])
        if self.t < self.started or self.fault == "dead":
            return
        if self.duty and self.us >= self.expiry_us:
            late_us = 5000 if self.fault == "late" else 500
            self.fell_us, self.duty = self.expiry_us + late_us, 0
        if self.session and self.t >= self._next_state:
            self._next_state = self.t + 0.01
            state = SupervisorState.DRIVING if self.duty else SupervisorState.IDLE
            self._send(
                WheelState(
                    self.boot_id, self.us, self.ticks, 0, 0, 0, self.duty, 0, 0, state, 0, 0, 0
                )
            )

    def _fail(self, request: SelfTestFail) -> None:
        failed_us = self.us
        self._start()
        self.last = (Failure(request.failure), request.core, failed_us, failed_us + 6000)
        self.reason = REASONS[Failure(request.failure)]
        if self.fault == "stays away":
            self.fault = "dead"

    # --- what it answers ---

    def _serve(self, message: Any) -> None:
        self.asked.append(message)
        if isinstance(message, Hello):
            self.session = message.nonce ^ self.boot_id
            dump = Capability.CORE_DUMP if self.last[0] else 0
            self._send(
                DeviceHello(
                    message.nonce, 2, schema_hash(), 0, self.boot_id, self.us, self.reason,
                    self.chip, 7, int(dump), 0, 1, 0, 0,
                )
            )  # fmt: skip
        elif message.session_id != self.session:
            return
        elif isinstance(message, Ping):
            if not (self.fault == "loses a ping" and message.request_id == 500):
                self._send(
                    Pong(self.session, message.request_id, message.host_us, self.us, self.us)
                )
        elif isinstance(message, SetDuty):
            self._obey(message)
        else:
            answer = self._fact(message, self.session, message.request_id)
            self._send(answer or self._answer(message, self.session, message.request_id))

    def _obey(self, setpoint: SetDuty) -> None:
        if not self.allowed or setpoint.expiry_us <= self.us:
            return
        duty, before = setpoint.left_duty_q15, self.duty
        kept = self.fault == "old duty" and duty < 0 < before
        self.pulses += [(duty, False)] if not kept else [(-before, False), (duty, False)]
        self.duty, self.expiry_us = duty, setpoint.expiry_us
        if duty == 0 and before:
            self.fell_us = self.us

    def _fact(self, message: Any, session: int, number: int) -> Any:
        match message:
            case GroupGet():
                found = HASH if message.group == GROUP and self.fault != "ordinary" else 0
                return GroupInfo(session, number, message.group, found)
            case ConfigurationGet():
                state = (
                    ConfigurationState.BUILT_IN
                    if self.fault == "unconfirmed"
                    else ConfigurationState.STORED
                )
                board = BOARD._replace(state=state, stage=self.stage)
                return board._replace(session_id=session, request_id=number)
            case BoxGet():
                return BoxValue(
                    session, number, 1, 0, 1, 1, 100, BoxCause.RESET, self.reason, *range(7)
                )
        return None

    def _answer(self, message: Any, session: int, number: int) -> Any:
        ack = Ack(session, number, 0)
        match message:
            case SelfTestAllow():
                self.allowed = message.permission == PERMISSION
                return ack
            case ParameterGet():
                value = self.values[message.parameter]
                return ParameterValue(session, number, message.parameter, value)
            case ParameterSet():
                self.values[message.parameter] = message.value
                return ParameterValue(session, number, message.parameter, message.value)
            case ParameterSave():
                self.saves += 1
                for parameter in [message.parameter] if message.parameter else self.values:
                    self.saved[parameter] = self.values[parameter]
                self.t += 0.6 if self.fault == "long save" else 0.2
                return ack
            case Restart():
                self._start()
                self.reason = ResetReason.SOFTWARE
                return ack
        if not self.allowed:
            return Refuse(session, 0, RefusalCode.NOT_SUPPORTED, number)
        return self._self_test(message, session, number)

    def _self_test(self, message: Any, session: int, number: int) -> Any:
        match message:
            case SelfTestFail():
                self.pending = (self.t + 0.02, message)
            case SelfTestTurn():
                lost = self.fault == "loses a tick" and abs(message.edges) == 200_000
                counted = -3 if self.fault == "no filter" else 1
                self.ticks += message.edges + lost + counted * message.spikes
            case SelfTestWatch():
                return self._report(session, number)
            case SelfTestLastGet():
                return SelfTestLast(session, number, *self.last)
        return Ack(session, number, 0)

    def _report(self, session: int, number: int) -> SelfTestReport:
        period = round(CAPTURE_HZ / self.frequency)
        pwm_hz = 80e6 if self.frequency >= 1221 else 5e6
        duties = [*self.pulses, (self.duty, True)]
        highs = [
            int(abs(duty) * (pwm_hz // self.frequency) // 32767 * CAPTURE_HZ / pwm_hz)
            for duty, _ in duties
        ]
        ticks = 3 if self.fault == "long pulse" else 0
        changes = any(duty not in (0, 32767) for duty, _ in duties)
        seen = [high + ticks * CAPTURE_HZ / pwm_hz for high in highs if 0 < high < period] or [0]
        sticks = self.fault == "direction sticks" and self.duty > 0
        other = [0, *(h for h, (duty, _) in zip(highs, duties, strict=True) if duty < 0 or sticks)]
        rises = 100 if changes else 0
        self.pulses.clear()
        resolution = CAPTURE_HZ if self.watches else 0
        self.watches = True
        return SelfTestReport(
            session, number, resolution, rises, rises, period, period,
            int(min(seen)), int(max(seen)), int(max(other)), self.fell_us, 0,
        )  # fmt: skip

    @property
    def frequency(self) -> float:
        """The frequency of the PWM, which a restart takes from the parameter."""
        return self.values[PARAMETER_BY_NAME["pwm_frequency_hz"].id]


@pytest.fixture(autouse=True)
def _less_often(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, count in (
        ("DEAD_S", 3.0),
        ("BOX_S", 0.1),
        ("CHANGES", 200),
        ("TURNS_AT_LIMIT", 5),
        ("EXPIRIES", 10),
        ("PINGS", 600),
    ):
        monkeypatch.setattr(hil_board, name, count)


def bench(fault: str = "", chip: Chip = Chip.ESP32) -> tuple[MadeUpBoard, Board]:
    device = MadeUpBoard(chip)
    device.fault = fault
    return device, Board(device, device.now, device.sleep)


def rows_that_fail(row: str, measured: hil.Measured) -> list[str]:
    return [check.what for check in hil.checks({row: measured}) if not check.passes]


def test_crashes_and_hangs_on_each_core_that_the_chip_has() -> None:
    for chip, cores in ((Chip.ESP32, [0, 1]), (Chip.ESP32C6, [0])):
        device, board = bench(chip=chip)
        measured = hil_board.measure_crashes(board, 1)
        assert rows_that_fail("crashes", measured) == []
        assert [event["core"] for event in measured["events"]] == [
            core for core in cores for _ in range(8)
        ]
        assert sum(isinstance(it, SelfTestFail) for it in device.asked) == 8 * len(cores)


def test_a_board_that_stays_away_ends_the_measurement() -> None:
    _, board = bench("stays away")
    measured = hil_board.measure(board, LOOPS, 1)
    assert list(measured) == ["crashes"]
    assert "back without a hand" in rows_that_fail("crashes", measured["crashes"])


def test_nothing_is_asked_of_it_before_the_permission() -> None:
    device, board = bench()
    hil_board.measure_crashes(board, 1)
    allowed = False
    for message in device.asked:
        if isinstance(message, Hello):
            allowed = False
        allowed = allowed or isinstance(message, SelfTestAllow)
        assert allowed or not isinstance(message, (SetDuty, SelfTestFail))


MEASURE: dict[str, Callable[[Board], hil.Measured]] = {
    "pwm": lambda board: hil_board.measure_pwm(board, LOOPS, 1),
    "counters": lambda board: hil_board.measure_counters(board, LOOPS, 1),
    "stops": lambda board: hil_board.measure_stops(board, LOOPS, 1),
    "line": lambda board: hil_board.measure_line(board, 1),
}


@pytest.mark.parametrize(
    ("row", "fault", "what"),
    [
        *((row, "", []) for row in MEASURE),
        ("pwm", "long pulse", ["high time"]),
        ("pwm", "old duty", ["a reversal shows more than its duty"]),
        ("pwm", "direction sticks", ["and of the old direction"]),
        ("counters", "loses a tick", ["through 100 000 ticks and back"]),
        ("counters", "no filter", ["100 spikes of 500 ns"]),
        ("stops", "late", ["drive after 10 deadlines"]),
        ("line", "loses a ping", ["of 600 pings at rest lost"]),
        ("line", "long save", ["longest pause of a save"]),
    ],
)
def test_each_row_fails_by_its_own_fault(row: str, fault: str, what: list[str]) -> None:
    device, board = bench(fault)
    saved = dict(device.saved)
    assert rows_that_fail(row, MEASURE[row](board)) == what
    assert device.saved == saved


@pytest.mark.parametrize("stage", [Stage.IN_IN, Stage.HALF_BRIDGES])
def test_a_stage_without_an_input_for_the_direction_has_no_reversals(stage: Stage) -> None:
    device, board = bench()
    device.stage = stage
    measured = hil_board.measure_pwm(board, LOOPS, 1)
    assert measured["reversals"] is None
    assert rows_that_fail("pwm", measured) == []


def test_all_rows_leave_what_is_saved_as_it_was() -> None:
    device, board = bench()
    saved = dict(device.saved)
    measured = hil_board.measure(board, LOOPS, 1)
    assert list(measured) == list(hil.ROWS)
    assert hil.failing_rows(hil.checks(measured)) == []
    assert {it["frequency_hz"] for it in measured["pwm"]["duties"]} == {20_000, 500}
    assert len(measured["stops"]["freezes"]) == 10
    assert measured["line"]["saves"] == 20
    assert device.saves > 20
    assert device.saved == saved


@pytest.mark.parametrize(
    ("fault", "says"),
    [("", "^no$"), ("dead", r"no answer .* save pwm_frequency_hz = 20000 again")],
)
def test_the_frequency_is_restored_when_a_measurement_ends_early_or_named(
    monkeypatch: pytest.MonkeyPatch, fault: str, says: str
) -> None:
    def fail(*_: object) -> object:
        device.fault = fault
        raise BoardError("no")

    monkeypatch.setattr(hil_board, "measure_duties", fail)
    device, board = bench()
    saved = dict(device.saved)
    with pytest.raises(BoardError, match=says):
        hil_board.measure_pwm(board, LOOPS, 1)
    assert device.saved == saved


def test_one_core_freezes_unseen() -> None:
    _, board = bench(chip=Chip.ESP32C6)
    measured = hil_board.measure_stops(board, LOOPS, 1)
    assert measured["freezes"] is None
    assert rows_that_fail("stops", measured) == []


def test_pings_do_not_use_up_the_numbers_of_requests() -> None:
    device, board = bench()
    board.open()
    board.get("max_duty")
    for _ in range(5):
        board.ping()
    board.get("max_duty")
    first, second = (it.request_id for it in device.asked if isinstance(it, ParameterGet))
    assert second == first + 1


def test_loops_are_read() -> None:
    assert hil_board.parsed_loops("25:18,26:19") == LOOPS
    assert hil_board.parsed_loops("") == []
    for wrong in ("25", "25:x", "25:18,26:19,1:2", "left:right"):
        with pytest.raises(BoardError, match="LOOP"):
            hil_board.parsed_loops(wrong)


def test_the_wires_that_a_board_is_suggested() -> None:
    pins = BOARD._replace(left_pwm=5, left_dir=6)
    for stage, wires in (
        (Stage.ENABLE_IN1_IN2, "25:18,26:19"),
        (Stage.PWM_IN1_IN2, "5:18,26:19"),
        (Stage.IN_IN, "26:18,27:19"),
        (Stage.HALF_BRIDGES, "26:18,27:19"),
        (Stage.PWM_DIR, "5:18,6:19"),
    ):
        assert hil_board.suggested_loops(pins._replace(stage=stage)) == wires


class TestCommand:
    """What `make hil` does on a board, after the contract."""

    @pytest.fixture
    def device(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> MadeUpBoard:
        device, at_bench = bench()
        monkeypatch.setattr(command, "SerialLine", lambda _: device)
        monkeypatch.setattr(command, "Board", lambda _: at_bench)
        output = str(tmp_path / "hil.json")
        monkeypatch.setattr("sys.argv", ["board.py", "--port", "x", "--output", output])
        return device

    @pytest.mark.parametrize(
        ("fault", "words", "code", "says", "asked"),
        [
            *(("", words, 2, "Nothing was measured", 4) for words in ("", "yes", "on")),
            ("ordinary", "off", 0, "flash the self-test image", 3),
            ("unconfirmed", "off", 2, "wheelwire board confirm", 4),
        ],
    )
    def test_nothing_is_driven_unless_board_image_and_user_allow_it(
        self,
        device: MadeUpBoard,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
        fault: str,
        words: str,
        code: int,
        says: str,
        asked: int,
    ) -> None:
        monkeypatch.setattr("builtins.input", lambda _: words)
        device.fault = fault
        assert command.main() == code
        assert says in capsys.readouterr().out
        assert device.asked
        allowed = (Hello, Ping, GroupGet, ConfigurationGet)[:asked]
        assert all(isinstance(message, allowed) for message in device.asked)

    def test_it_measures_and_prints_the_table_and_the_wires(
        self,
        device: MadeUpBoard,
        monkeypatch: pytest.MonkeyPatch,
        tmp_path: Path,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        monkeypatch.setattr("builtins.input", lambda _: "off")
        assert command.main() == 0
        printed = capsys.readouterr().out
        assert "LOOP=25:18,26:19" in printed
        assert "| crashes | back without a hand | each time |" in printed
        assert list(json.loads((tmp_path / "hil.json").read_text())) == ["crashes", "line"]
        device.fault = "loses a ping"
        assert command.main() == 1
        assert "FAILED line" in capsys.readouterr().out
