"""The order in which the inputs of a power stage change."""

from __future__ import annotations

import pytest

from wheelwire.pi.gpio.base import HIGH_Q15, StagePins
from wheelwire_protocol.core import StageInputs
from wheelwire_protocol.power_stages import OUTPUTS, STAGES, Stage

LOW = StageInputs(0, 0, 0, 0, 0)
HIGH = StageInputs(*[HIGH_Q15] * len(OUTPUTS))


class Recorded(StagePins):
    """Notes which inputs are set, in order."""

    def __init__(self, names: list[str]) -> None:
        super().__init__(names)
        self.order: list[str] = []

    def set_input(self, name: str, duty: float) -> None:  # noqa: ARG002 - the order counts
        self.order.append(name)


def recorded(stage: Stage, *, pwm_last: bool) -> Recorded:
    """With the names as a backend gives them: the levels before the PWM, or behind it."""
    names = sorted(STAGES[stage].inputs, key=lambda name: (name in ("enable", "pwm")) == pwm_last)
    return Recorded(names)


@pytest.mark.parametrize("pwm_last", [True, False])
@pytest.mark.parametrize("stage", Stage)
def test_inputs_fall_from_the_first_to_the_last_and_rise_from_the_last_to_the_first(
    stage: Stage, pwm_last: bool
) -> None:
    in_order = [name for name in OUTPUTS if name in STAGES[stage].inputs]
    pins = recorded(stage, pwm_last=pwm_last)
    pins.apply(HIGH)
    assert pins.order == in_order[::-1]
    pins.order.clear()
    pins.apply(LOW)
    assert pins.order == in_order


def test_a_reversal_lets_go_of_one_direction_before_it_takes_the_other() -> None:
    pins = recorded(Stage.ENABLE_IN1_IN2, pwm_last=True)
    pins.apply(LOW._replace(enable_q15=100, in1_q15=HIGH_Q15))
    pins.order.clear()
    pins.apply(LOW._replace(enable_q15=50, in2_q15=HIGH_Q15))
    assert pins.order == ["enable", "in1", "in2"]
