"""The firmware's core as a library: the same robot, behind a C interface."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.library_robot import LibraryRobot
from wheelwire_protocol import native
from wheelwire_protocol.codes import Chip, RefusalCode, SupervisorState
from wheelwire_protocol.core import Core, Identity, StageInputs
from wheelwire_protocol.native import NativeMissingError
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import (
    ParameterEntry,
    ParameterGet,
    ParameterList,
    ParameterReset,
    ParameterSet,
    ParameterValue,
)

FULL = 32767
COAST = 0
BRAKE = StageInputs(FULL, 0, 0, 0, 0)


def parameter(robot: LibraryRobot, name: str) -> float:
    answer = robot.request(ParameterGet(0, 0, PARAMETER_BY_NAME[name].id))
    assert isinstance(answer, ParameterValue)
    return answer.value


def state(robot: LibraryRobot) -> SupervisorState:
    return robot.outputs.state


def drive(robot: LibraryRobot, left: float, right: float) -> None:
    """Drive until the duty is reached, with wheels that turn."""
    for _ in range(30):
        robot.set_duty(left, right)
        robot.left_ticks += round(20 * left)
        robot.right_ticks += round(20 * right)
        robot.step()


def test_before_the_start_nothing_moves() -> None:
    core = Core(Identity(1, Chip.LINUX))
    outputs = core.step(1_000, 5, 5)
    assert outputs.state is SupervisorState.BOOT
    assert outputs.left == outputs.right == StageInputs(COAST, 0, 0, 0, 0)
    assert core.service(2_000).state is SupervisorState.BOOT


@pytest.fixture
def robot() -> LibraryRobot:
    return LibraryRobot().open()


def test_a_duty_becomes_pins_until_the_deadline(robot: LibraryRobot) -> None:
    drive(robot, 0.5, -0.25)
    assert state(robot) is SupervisorState.DRIVING
    assert robot.outputs.left == StageInputs(round(0.5 * FULL), FULL, 0, 0, 0)
    assert robot.outputs.right == StageInputs(round(0.25 * FULL), 0, FULL, 0, 0)
    deadline_us = robot.outputs.deadline_us
    robot.run_until(lambda: state(robot) is not SupervisorState.DRIVING)
    assert state(robot) is SupervisorState.TIMED_OUT
    assert deadline_us <= robot.now_us <= deadline_us + robot.outputs.period_us
    assert robot.outputs.left.enable_q15 == robot.outputs.right.enable_q15 == COAST
    robot.step()  # the bridge's inputs switch a period later
    assert robot.outputs.left == robot.outputs.right == BRAKE


def test_a_computer_has_its_own_defaults_and_a_reset_restores_them(robot: LibraryRobot) -> None:
    assert robot.outputs.period_us == 10_000
    assert parameter(robot, "estop_input_enabled") == 0
    rate = PARAMETER_BY_NAME["control_rate_hz"].id
    robot.request(ParameterSet(0, 0, rate, 500))
    assert robot.step().period_us == 2_000
    robot.request(ParameterReset(0, 0))
    assert robot.step().period_us == 10_000
    entry = robot.request(ParameterList(0, 0, rate - 1))
    assert isinstance(entry, ParameterEntry)
    assert entry.default_value == 100


def test_presets_are_defaults_and_are_checked() -> None:
    robot = LibraryRobot()
    radius = PARAMETER_BY_NAME["wheel_radius"].id
    assert robot.core.preset(radius, 0.05) is RefusalCode.NONE
    assert robot.core.preset(radius, 5) is RefusalCode.OUT_OF_RANGE
    assert robot.core.preset(200, 1) is RefusalCode.UNKNOWN_PARAMETER
    robot.open()
    assert parameter(robot, "wheel_radius") == pytest.approx(0.05)
    robot.request(ParameterSet(0, 0, radius, 0.06))
    robot.request(ParameterReset(0, 0))
    assert parameter(robot, "wheel_radius") == pytest.approx(0.05)


def test_a_closed_core_says_so() -> None:
    core = Core(Identity(1, Chip.LINUX))
    core.close()
    core.close()
    with pytest.raises(ValueError, match="closed"):
        core.step(0, 0, 0)


@pytest.fixture
def unloaded(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setattr(native, "load", native.load.__wrapped__)
    return monkeypatch


def test_a_missing_library_names_the_cure(unloaded: pytest.MonkeyPatch, tmp_path: Path) -> None:
    unloaded.setattr(native, "_CHECKOUT", tmp_path)
    unloaded.setattr(native, "_PACKAGE", tmp_path)
    with pytest.raises(NativeMissingError, match="does not exist; install a wheel of wheelwire"):
        native.load()
    (tmp_path / "firmware").mkdir()
    with pytest.raises(NativeMissingError, match="does not exist; build it with `make sim`"):
        native.load()
    assert not native.is_present()


@pytest.mark.parametrize("changed", ["ABI", "SCHEMA_HASH"])
def test_a_library_of_another_release_is_refused(
    unloaded: pytest.MonkeyPatch, changed: str
) -> None:
    unloaded.setattr(native, changed, 99)
    with pytest.raises(NativeMissingError, match="is of another release; build it with"):
        native.load()


def test_a_file_that_is_no_library_is_refused(unloaded: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "other.so").write_text("no library")
    unloaded.setenv(native.ENVIRONMENT, str(tmp_path / "other.so"))
    with pytest.raises(NativeMissingError, match="WHEELWIRE_CORE"):
        native.load()
