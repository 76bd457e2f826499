"""The measurements of `make hil` on the simulated board pass, and each fault fails in its row."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest

from support import hil
from support.mutants import DATA, ROOT, load

PROGRAM = ROOT / "build" / "host" / "wheelwire-hil-sim"


@pytest.fixture(scope="module")
def measured() -> hil.Measured:
    return hil.simulate(PROGRAM)


def test_the_firmware_passes_every_row(measured: hil.Measured) -> None:
    found = hil.checks(measured)
    assert [check for check in found if not check.passes] == []
    assert list(dict.fromkeys(check.row for check in found)) == list(hil.ROWS)


@pytest.mark.whole
def test_it_passes_ten_times_as_often() -> None:
    assert hil.failing_rows(hil.checks(hil.simulate(PROGRAM, 10))) == []


def test_each_row_has_a_fault() -> None:
    rows = {mutant.name.partition("-")[0] for mutant in load(DATA / "hil.toml").mutants}
    assert rows == set(hil.ROWS)


def event(measured: Any) -> Any:
    return measured["crashes"]["events"][0]


WORSE: dict[str, tuple[str, Callable[[Any], object]]] = {
    "never back": ("crashes", lambda it: event(it).update(is_back=False)),
    "too late": ("crashes", lambda it: event(it).update(back_s=15.1)),
    "wrong reason": ("crashes", lambda it: event(it).update(reason="POWER_ON")),
    "motors on": ("crashes", lambda it: event(it).pop("released_ms")),
    "no dump": ("crashes", lambda it: event(it).update(has_dump=False)),
    "stood": ("crashes", lambda it: event(it).update(drove=False)),
    "no event at all": ("crashes", lambda it: it["crashes"]["events"].clear()),
    "no box": ("crashes", lambda it: it["crashes"].pop("box_is_of_reset")),
    "three ticks": ("pwm", lambda it: it["pwm"]["duties"][0].update(worst_ticks=3)),
    "an edge": ("pwm", lambda it: it["pwm"]["duties"][0].update(edges_of_levels=1)),
    "slower": ("pwm", lambda it: it["pwm"]["duties"][0].update(period_us=51.0)),
    "a wrong change": ("pwm", lambda it: it["pwm"]["changes"][1].update(wrong=1)),
    "the old duty": ("pwm", lambda it: it["pwm"]["reversals"][1].update(most_part=0.2)),
    "a tick": ("counters", lambda it: it["counters"].update(error_ticks=-1)),
    "a spike": ("counters", lambda it: it["counters"].update(error_of_spikes_ticks=1)),
    "late stop": ("stops", lambda it: it["stops"]["expiries"].update(longest_ms=1.2)),
    "no stop seen": ("stops", lambda it: it["stops"]["expiries"].update(count=0)),
    "late release": ("stops", lambda it: it["stops"]["freezes"][3].update(released_ms=7.1)),
    "a lost ping": ("line", lambda it: it["line"].update(lost=1)),
    "a lost save": ("line", lambda it: it["line"].update(saved=19)),
    "a long pause": ("line", lambda it: it["line"].update(longest_pause_ms=451.0)),
    "a reset": ("line", lambda it: it["line"].update(resets=1)),
}


@pytest.mark.parametrize("name", WORSE)
def test_a_worse_board_fails_in_its_row(measured: hil.Measured, name: str) -> None:
    row, spoil = WORSE[name]
    spoiled = copy.deepcopy(measured)
    spoil(spoiled)
    assert hil.failing_rows(hil.checks(spoiled)) == [row]


def test_the_table_can_be_pasted(measured: hil.Measured) -> None:
    lines = hil.markdown(hil.checks(measured)).splitlines()
    assert {line.count("|") for line in lines} == {6}
    assert all(line.endswith("| passes |") for line in lines[2:])
