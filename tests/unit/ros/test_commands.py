from __future__ import annotations

import pytest

from wheelwire_ros.commands import CommandGate, CommandIgnored, Ignored, command_age_s

SECOND = 1_000_000_000
NOW = 1_700_000_000 * SECOND


@pytest.mark.parametrize("age_s", [0.5, 0.6, 1e9])
def test_a_command_older_than_the_timeout_is_stale(age_s: float) -> None:
    with pytest.raises(CommandIgnored) as ignored:
        CommandGate(timeout_s=0.5).check(born_s=100.0 - age_s, now_s=100.0)
    assert ignored.value.reason is Ignored.STALE


def test_a_command_of_before_the_reconnect_is_void_though_it_is_fresh() -> None:
    gate = CommandGate(timeout_s=0.5, connected_s=99.9)
    with pytest.raises(CommandIgnored) as ignored:
        gate.check(born_s=99.8, now_s=100.0)
    assert ignored.value.reason is Ignored.BEFORE_RECONNECT
    gate.check(born_s=99.95, now_s=100.0)


@pytest.mark.parametrize("stamp_ns", [None, 0])
def test_without_a_stamp_a_command_is_as_old_as_its_arrival(stamp_ns: int | None) -> None:
    assert command_age_s(stamp_ns, NOW, SECOND // 10) == pytest.approx(0.1)


def test_a_stamp_tells_the_age() -> None:
    assert command_age_s(NOW - SECOND, NOW, 0) == pytest.approx(1.0)


def test_a_stamp_from_the_future_gains_no_life() -> None:
    assert command_age_s(NOW + 60 * SECOND, NOW, SECOND // 5) == pytest.approx(0.2)


def test_a_wall_clock_that_was_set_back_makes_no_command_younger_than_it_is() -> None:
    assert command_age_s(None, NOW, -SECOND) == 0
