"""Each staged stop is named right: one cause, or those that the data leaves open."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.staged_stops import STAGED, diagnosed
from wheelwire.diagnosis.causes import (
    CAUSES,
    HELD,
    OTHER_FAULTS,
    REFUSALS,
    REQUEST_REFUSALS,
    RESETS,
    WHEEL_FAULTS,
)
from wheelwire_protocol.codes import Fault, RefusalCode, ResetReason

PAGE = Path(__file__).parents[3] / "docs" / "causes.md"


@pytest.mark.parametrize("name", STAGED)
def test_a_staged_stop_is_named(name: str) -> None:
    staged = STAGED[name]
    stops = diagnosed(staged)
    assert tuple(stop.cause for stop in stops) == staged.stops, [one.evidence for one in stops]
    for stop in stops:
        assert stop.sentence.endswith(".")
        assert stop.evidence
        assert stop.look_at


@pytest.mark.parametrize("seed", range(2, 6))
@pytest.mark.parametrize("name", ["encoder dead", "wheel blocked", "motor's wire off"])
def test_what_looks_alike_is_told_apart_by_any_seed(name: str, seed: int) -> None:
    assert [stop.cause for stop in diagnosed(STAGED[name], seed)] == list(STAGED[name].stops)


def test_a_wheel_is_named_by_its_side() -> None:
    (stop,) = diagnosed(STAGED["encoder dead, right"])
    assert stop.sentence.startswith("Right wheel stopped counting")


def test_every_fault_reset_and_refusal_has_a_cause() -> None:
    assert set(WHEEL_FAULTS) | set(OTHER_FAULTS) == set(Fault)
    assert set(RESETS) == set(ResetReason)
    named = {name for _, name in WHEEL_FAULTS.values()}
    named |= {
        *OTHER_FAULTS.values(),
        *RESETS.values(),
        *REFUSALS.values(),
        *REQUEST_REFUSALS.values(),
    }
    assert named <= set(CAUSES)
    tables = (*REFUSALS, *REQUEST_REFUSALS, *HELD)
    assert set(tables) == set(RefusalCode) - {RefusalCode.NONE}
    assert len(tables) == len(set(tables))


def test_the_page_has_the_same_causes() -> None:
    rows = re.findall(r"^\| `(\w+)` \|", PAGE.read_text("utf-8"), re.MULTILINE)
    assert set(rows) == set(CAUSES)
    assert len(rows) == len(set(rows))
