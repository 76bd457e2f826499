"""What a session knows of its application's trial, while another thread leaves it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from support.bytecodes import interrupted
from wheelwire.errors import DeviceRefused
from wheelwire.link.requests import HeldTrial
from wheelwire_protocol.codes import RefusalCode, TrialAction
from wheelwire_protocol.types import ParameterTrial

BEGIN = ParameterTrial(0, 0, TrialAction.BEGIN, 1.0)
DUE_US = 250_000

CALLS: dict[str, Callable[[HeldTrial], object]] = {
    "lose": HeldTrial.lose,
    "renewal": lambda trial: trial.renewal(DUE_US),
    "renewed": HeldTrial.renewed,
    "keep": lambda trial: trial.on_request(ParameterTrial(0, 0, TrialAction.KEEP, 0.0)),
}


def begun() -> HeldTrial:
    trial = HeldTrial()
    trial.on_request(BEGIN)
    trial.on_done(BEGIN, 0)
    return trial


def left_during(name: str, step: int) -> HeldTrial | None:
    """A trial that is released before bytecode number `step` of a call; None if it has fewer."""
    trial = begun()
    return trial if interrupted(lambda: CALLS[name](trial), step, trial.release) else None


@pytest.mark.parametrize("name", CALLS)
def test_a_trial_that_is_left_at_any_moment_is_left(name: str) -> None:
    step = 1
    while (trial := left_during(name, step)) is not None:
        trial.check("the setpoint")
        trial.on_request(BEGIN)  # refused while one is held
        assert trial.due_us is None
        step += 1
    assert step > 5


def test_a_trial_that_was_lost_is_refused_until_it_is_left() -> None:
    trial = begun()
    trial.lose()
    with pytest.raises(DeviceRefused) as refused:
        trial.check("the setpoint")
    assert refused.value.code == RefusalCode.NO_TRIAL
    assert trial.renewal(DUE_US) is None
    trial.release()
    trial.check("the setpoint")


def test_one_renewal_at_a_time() -> None:
    trial = begun()
    assert trial.renewal(DUE_US - 1) is None
    assert trial.renewal(DUE_US) is not None
    assert trial.renewal(2 * DUE_US) is None
    trial.renewed()
    assert trial.renewal(2 * DUE_US) is not None
