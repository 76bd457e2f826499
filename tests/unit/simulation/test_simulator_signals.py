"""Commands to the simulator's process, interrupted by signal handlers."""

import signal
from collections.abc import Iterator
from types import FrameType

import pytest

from wheelwire.errors import WheelwireError
from wheelwire.simulation.simulator import Simulator

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
def test_a_command_in_a_handler_is_told_when_it_interrupts_another(simulator: Simulator) -> None:
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
