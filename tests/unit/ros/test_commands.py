"""What is decided about commands without a node."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from wheelwire_ros.commands import AUTO, CHANCE_S, PLAIN, STAMPED, CommandType, command_age_s

SECOND = 1_000_000_000
NOW = 1_700_000_000 * SECOND
BOTH = {PLAIN, STAMPED}


def test_it_is_twist_until_a_publisher_of_the_other_is_there() -> None:
    type_ = CommandType(AUTO)
    assert not type_.look(set(), 0.0)
    assert not type_.look({PLAIN}, 1.0)
    assert (type_.name, type_.is_decided) == (PLAIN, False)
    assert type_.look({STAMPED}, 2.0)
    assert type_.name == STAMPED


def test_a_message_decides_until_its_last_publisher_is_gone() -> None:
    type_ = CommandType(AUTO)
    assert type_.decide()
    assert not type_.decide()
    assert not type_.look(BOTH, 1.0)
    assert not type_.look(BOTH, 100.0)
    assert type_.look({STAMPED}, 101.0)
    assert not type_.is_decided


def test_a_publisher_that_comes_back_beside_another_decides_nothing() -> None:
    type_ = CommandType(AUTO)
    type_.decide()
    assert not type_.look(set(), 1.0)
    assert type_.look(BOTH, 2.0)


def test_while_two_are_silent_each_gets_its_time() -> None:
    type_ = CommandType(AUTO)
    changes = [now_s for now_s in range(40) if type_.look(BOTH, now_s * CHANCE_S / 4)]
    assert changes == list(range(0, 40, 4))


@pytest.mark.parametrize("name", [PLAIN, STAMPED])
def test_a_given_type_stays(name: str) -> None:
    type_ = CommandType(name)
    assert not type_.look(BOTH - {name}, 1.0)
    assert not type_.decide()
    assert type_.name == name


@pytest.mark.parametrize("stamp_ns", [None, 0])
def test_without_a_stamp_a_command_is_as_old_as_its_arrival(stamp_ns: int | None) -> None:
    assert command_age_s(stamp_ns, NOW, SECOND // 10) == pytest.approx(0.1)


def test_a_stamp_tells_the_age() -> None:
    assert command_age_s(NOW - SECOND, NOW, 0) == pytest.approx(1.0)


def test_a_stamp_from_the_future_gains_no_life() -> None:
    assert command_age_s(NOW + 60 * SECOND, NOW, SECOND // 5) == pytest.approx(0.2)


def test_a_wall_clock_that_was_set_back_makes_no_command_younger_than_it_is() -> None:
    assert command_age_s(None, NOW, -SECOND) == 0
