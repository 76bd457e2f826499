"""Commands to the simulator's process, interrupted by signal handlers."""

import signal
from collections.abc import Iterator
from types import FrameType

import pytest

from support.waiting import wait_until
from wheelwire.errors import WheelwireError
from wheelwire.simulation.simulator import Simulator, TrueState

TICK_S = 0.003
TICKS = 100


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator() as simulator:
        yield simulator


@pytest.fixture
def alarms() -> Iterator[None]:
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)


@pytest.mark.usefixtures("alarms")
def test_a_command_in_a_handler_is_refused_when_it_interrupts_another(simulator: Simulator) -> None:
    values: list[float] = []
    refused: list[str] = []

    def ask(_number: int, _frame: FrameType | None) -> None:
        try:
            values.append(simulator.get("stands_still"))
        except WheelwireError as error:
            refused.append(str(error))

    signal.signal(signal.SIGALRM, ask)
    signal.setitimer(signal.ITIMER_REAL, TICK_S, TICK_S)
    while len(values) + len(refused) < TICKS:
        assert simulator.get("drive_on") == 0
    assert refused
    assert set(values) <= {1.0}
    assert "interrupts another command" in refused[0]


class InterruptedCallError(Exception):
    """What a signal handler raises."""


@pytest.mark.usefixtures("alarms")
def test_an_interrupted_command_leaves_its_answer_to_nobody(simulator: Simulator) -> None:
    """The answer comes after its caller has gone on, and is not the next command's."""
    boot_time_us = simulator.get("boot_time_us")

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise InterruptedCallError

    signal.signal(signal.SIGALRM, interrupt)
    interrupted = 0
    for attempt in range(2000):
        try:  # around the timer, too: it may go off before the call begins
            signal.setitimer(signal.ITIMER_REAL, 0.00002 * (attempt % 20 + 1))
            simulator.get("stands_still")
            signal.setitimer(signal.ITIMER_REAL, 0)
        except InterruptedCallError:
            interrupted += 1
        assert simulator.get("boot_time_us") == boot_time_us
        if interrupted == 50:
            break
    assert interrupted


def test_an_exception_in_on_state_ends_nothing(caplog: pytest.LogCaptureFixture) -> None:
    seen: list[TrueState] = []

    def note(state: TrueState) -> None:
        seen.append(state)
        if len(seen) == 1:
            raise ZeroDivisionError

    with Simulator(truth_hz=200, on_state=note) as simulator:
        wait_until(lambda: len(seen) > 3)
        assert simulator.get("drive_on") == 0
    assert "on_state of the simulator failed" in caplog.text


def test_output_that_cannot_be_read_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_line: object) -> TrueState:
        raise KeyError("left_mps")

    monkeypatch.setattr("wheelwire.simulation.simulator.parse_true_state", fail)
    with Simulator(truth_hz=200) as simulator:
        wait_until(lambda: simulator._unreadable)
        for _ in range(2):
            with pytest.raises(WheelwireError, match=r"cannot be read \(KeyError"):
                simulator.get("drive_on")
