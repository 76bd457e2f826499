"""Values on trial."""

from __future__ import annotations

from typing import cast

import pytest

from wheelwire.connect import open_driver
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.errors import DeviceRefused, InvalidCommand, ParameterOutOfRange, WheelwireError
from wheelwire.tools.view.tuning import LOST, Tuning


@pytest.fixture
def robot() -> VirtualMockDriver:
    return cast("VirtualMockDriver", open_driver("mock", realtime=False))


@pytest.fixture
def tuning(robot: VirtualMockDriver) -> Tuning:
    tuning = Tuning(robot.parameters, lambda _: None)
    tuning.read()
    return tuning


def test_steps_are_undone_in_their_order(robot: VirtualMockDriver, tuning: Tuning) -> None:
    for value in ("0.9", "0.8", "0,7"):
        tuning.set("max_duty", value)
    assert robot.parameters["max_duty"] == pytest.approx(0.7)
    tuning.undo()
    assert robot.parameters["max_duty"] == pytest.approx(0.8)
    tuning.undo()
    tuning.undo()
    assert robot.parameters["max_duty"] == 1.0
    assert not tuning.changed
    with pytest.raises(InvalidCommand, match="nothing to undo"):
        tuning.undo()


def test_a_revert_takes_all_back(robot: VirtualMockDriver, tuning: Tuning) -> None:
    tuning.set("max_duty", "0.9")
    tuning.set("max_velocity_mps", "0.3")
    tuning.revert()
    assert tuning.values["max_duty"] == robot.parameters["max_duty"] == 1.0
    assert robot.parameters["max_velocity_mps"] == 0.4
    with pytest.raises(InvalidCommand, match="nothing to revert"):
        tuning.revert()


def test_a_save_saves_what_was_changed_and_nothing_else(
    robot: VirtualMockDriver, tuning: Tuning
) -> None:
    robot.parameters.set("max_velocity_mps", 0.2)
    tuning.set("max_duty", "0.9")
    assert tuning.save() == "saved: max_duty"
    assert tuning.values["max_duty"] == pytest.approx(0.9)
    robot.simulator.reset()
    robot.advance(2.0)
    assert robot.parameters["max_duty"] == pytest.approx(0.9)
    assert robot.parameters["max_velocity_mps"] == 0.4
    with pytest.raises(InvalidCommand, match="nothing to save"):
        tuning.save()


def test_values_that_could_not_be_saved_are_active_and_saved_by_the_next_save(
    robot: VirtualMockDriver, tuning: Tuning
) -> None:
    tuning.set("max_duty", "0.9")
    robot.set_velocity(0.1, 0.0, ttl=0.5)
    robot.advance(0.2)
    with pytest.raises(DeviceRefused):
        tuning.save()
    assert not tuning.is_active
    assert tuning.unsaved == ["max_duty"]
    robot.stop()
    robot.advance(1.0)
    assert tuning.save() == "saved: max_duty"
    assert not tuning.unsaved


def test_a_refused_value_leaves_no_empty_trial(robot: VirtualMockDriver, tuning: Tuning) -> None:
    with pytest.raises(ParameterOutOfRange):
        tuning.set("max_duty", "2")
    assert not tuning.is_active
    with pytest.raises(WheelwireError):
        tuning.set("estop_input_enabled", "0")  # cannot be on trial
    assert not tuning.is_active
    with robot.parameters.trial():
        """Another one may begin."""


def test_a_refused_value_leaves_the_others_on_trial(
    robot: VirtualMockDriver, tuning: Tuning
) -> None:
    tuning.set("max_duty", "0.9")
    with pytest.raises(WheelwireError):
        tuning.set("estop_input_enabled", "0")
    assert tuning.is_active
    assert robot.parameters["max_duty"] == pytest.approx(0.9)


def test_a_trial_that_was_lost_shows_the_previous_values(
    robot: VirtualMockDriver, tuning: Tuning
) -> None:
    tuning.set("max_duty", "0.9")
    robot.unplug()
    robot.advance(5.0)
    robot.plug()
    robot.advance(2.0)
    with pytest.raises(InvalidCommand, match=LOST):
        tuning.set("max_duty", "0.8")
    assert not tuning.is_active
    assert tuning.values["max_duty"] == robot.parameters["max_duty"] == 1.0


def test_without_a_link_a_trial_is_left_all_the_same(
    robot: VirtualMockDriver, tuning: Tuning
) -> None:
    tuning.set("max_duty", "0.9")
    robot.unplug()
    robot.advance(1.0)
    assert tuning.lose() == LOST
    assert not tuning.is_active
