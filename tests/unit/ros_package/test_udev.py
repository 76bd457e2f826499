"""The udev rules: two ports, told apart by nothing but where they are plugged in."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

RULES = Path(__file__).parents[3] / "ros_node" / "udev" / "70-wheelwire.rules"
TERM = re.compile(r'(?P<key>[A-Z]+(\{\w+\})?)(?P<operator>==|\+=|=)"(?P<value>[^"]*)"')

Rule = dict[str, tuple[str, str]]
"""Key -> operator and value."""


@pytest.fixture(scope="module")
def rules() -> list[Rule]:
    lines = [line.strip() for line in RULES.read_text().splitlines()]
    return [_rule(line) for line in lines if line and not line.startswith("#")]


def _rule(line: str) -> Rule:
    terms = [TERM.fullmatch(term) for term in re.split(r",\s*", line)]
    assert all(terms), line
    return {t["key"]: (t["operator"], t["value"]) for t in terms if t}


def test_two_links_by_two_sockets(rules: list[Rule]) -> None:
    assert [rule["SYMLINK"] for rule in rules] == [("+=", "wheelwire"), ("+=", "rplidar")]
    paths = [rule["ENV{ID_PATH}"] for rule in rules]
    assert [operator for operator, _ in paths] == ["==", "=="]
    assert len({path for _, path in paths}) == 2


def test_nothing_else_is_matched(rules: list[Rule]) -> None:
    for rule in rules:
        matched = {key for key, (operator, _) in rule.items() if operator == "=="}
        assert matched == {"SUBSYSTEM", "ENV{ID_PATH}"}
        assert rule["SUBSYSTEM"] == ("==", "tty")


def test_users_may_open_them(rules: list[Rule]) -> None:
    for rule in rules:
        assert rule["GROUP"] == ("=", "dialout")
        assert rule["MODE"] == ("=", "0660")
        assert rule["TAG"] == ("+=", "uaccess")


def test_it_comes_when_it_can_act() -> None:
    """ID_PATH is known from 60-serial.rules on, uaccess is carried out in 73-seat-late.rules."""
    assert 60 < int(RULES.name.partition("-")[0]) < 73
