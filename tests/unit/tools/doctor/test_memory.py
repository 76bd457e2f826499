"""What the doctor and `info` say of a chip's memory."""

from __future__ import annotations

from unittest.mock import Mock

import pytest

from wheelwire.errors import GroupUnavailable
from wheelwire.tools.doctor import robot as checks
from wheelwire_protocol.types import MemoryValue

SOUND = MemoryValue(0, 0, 90_000, 80_000, 5000, 1800, 0)


def found(left: MemoryValue | None) -> list[str]:
    """What is found with so much left; None: the chip cannot tell."""
    chip = Mock(memory=Mock(side_effect=[left or GroupUnavailable("platform", 1, 0)]))
    return [finding.problem for finding in checks._memory(chip, "/dev/ttyUSB0")]


@pytest.mark.parametrize(
    ("left", "what"),
    [
        (SOUND._replace(least_free_heap=9_999), "heap"),
        (SOUND._replace(sensors_stack=511), "stack of the sensors task"),
        (SOUND._replace(least_free_heap=0, control_stack=16), "heap and stack of the control task"),
    ],
)
def test_scarce_resources_are_named(left: MemoryValue, what: str) -> None:
    assert found(left) == [f"the chip was about to run out of {what}."]


def test_a_sound_robot_and_one_that_cannot_tell_have_no_finding() -> None:
    assert found(SOUND) == found(None) == []
    # Before the first measurement.
    assert found(SOUND._replace(control_stack=0, housekeeping_stack=0)) == []


def test_the_facts_name_the_task_that_has_least() -> None:
    assert checks.memory_facts(SOUND) == {
        "free heap": "90000 bytes; never less than 80000",
        "lowest stack": "1800 bytes, in the housekeeping task",
    }
