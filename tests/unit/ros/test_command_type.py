from __future__ import annotations

import pytest

from wheelwire_ros.command_type import PLAIN, STAMPED, TURN_S, CommandType
from wheelwire_ros.commands import AUTO, LogPace
from wheelwire_ros.twins import FORGOTTEN_S, TwinWatch

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


def test_while_two_are_silent_each_has_its_turn() -> None:
    type_ = CommandType(AUTO)
    changes = [now_s for now_s in range(40) if type_.look(BOTH, now_s * TURN_S / 4)]
    assert changes == list(range(0, 40, 4))


@pytest.mark.parametrize("name", [PLAIN, STAMPED])
def test_a_given_type_stays(name: str) -> None:
    type_ = CommandType(name)
    assert not type_.look(BOTH - {name}, 1.0)
    assert not type_.decide()
    assert type_.name == name


def test_two_reasons_that_alternate_are_two_lines_a_period() -> None:
    pace = LogPace(5.0)
    assert sum(pace.is_due(tick % 2, tick / 50) for tick in range(240)) == 2
    assert pace.is_due(0, 5.0)


def test_a_node_that_was_killed_is_no_twin() -> None:
    twins = TwinWatch()
    assert not any(twins.look(2, float(now_s)) for now_s in range(int(FORGOTTEN_S)))
    assert not twins.look(1, FORGOTTEN_S)
    assert not twins.look(2, FORGOTTEN_S + 1)
    assert twins.look(2, 2 * FORGOTTEN_S + 1)
    assert not twins.look(2, 2 * FORGOTTEN_S + 2)  # it is said once
    assert twins.has_twin
