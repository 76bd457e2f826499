"""The firmware's core as a library: the same robot, behind a C interface."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.library_robot import LibraryRobot
from wheelwire.errors import DeviceRefused, LinkLost
from wheelwire_protocol import native
from wheelwire_protocol.codes import Chip, Fault, RefusalCode, StopMode, SupervisorState
from wheelwire_protocol.core import Core, Identity, StageInputs
from wheelwire_protocol.native import NativeMissingError
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, PARAMETERS
from wheelwire_protocol.types import (
    ClearEstop,
    ControlCounters,
    ControlCountersGet,
    ParameterEntry,
    ParameterGet,
    ParameterList,
    ParameterReset,
    ParameterSave,
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


def test_ticks_are_reported_and_wrap() -> None:
    robot = LibraryRobot()
    robot.left_ticks, robot.right_ticks = 2**31 - 10, -(2**31) + 10
    robot.open()
    robot.left_ticks += 100
    robot.right_ticks -= 100
    robot.step()
    robot.step()
    assert robot.samples[-1].left_ticks == 100
    assert robot.samples[-1].right_ticks == -100


def test_no_tick_is_lost_in_a_step_that_came_late(robot: LibraryRobot) -> None:
    robot.left_ticks += 100_000
    robot.right_ticks -= 60_000
    for _ in range(10):
        robot.step()
    assert robot.samples[-1].left_ticks == 100_000
    assert robot.samples[-1].right_ticks == -60_000


def test_a_stop_between_two_steps_acts_at_once(robot: LibraryRobot) -> None:
    drive(robot, 0.5, 0.5)
    robot.session.stop(StopMode.COAST, lambda _result: None, robot.now_us)
    robot.core.feed(robot.session.take_output())
    outputs = robot.core.service(robot.now_us + 1)
    assert outputs.state is SupervisorState.IDLE
    assert outputs.left.enable_q15 == outputs.right.enable_q15 == COAST


def test_a_host_that_hangs_up_ends_its_drive_and_its_session_at_once(robot: LibraryRobot) -> None:
    drive(robot, 0.5, 0.5)
    robot.set_duty(0.5, 0.5)
    unread = robot.session.take_output()
    outputs = robot.core.hang_up(robot.now_us)
    assert outputs.state is SupervisorState.IDLE
    assert (outputs.left.enable_q15, outputs.right.enable_q15) == (0, 0)
    robot.core.feed(unread)
    assert robot.core.service(robot.now_us).state is SupervisorState.IDLE
    robot.core.take()  # the refusal
    for _ in range(200):
        robot.now_us += 10_000
        assert robot.core.step(robot.now_us, 0, 0).state is SupervisorState.IDLE
        assert not robot.core.take()
    assert outputs.left != BRAKE


def test_after_a_host_that_hung_up_the_next_one_drives(robot: LibraryRobot) -> None:
    drive(robot, 0.5, 0.5)
    robot.core.hang_up(robot.now_us)
    robot.session.disconnect(LinkLost("hung up"))
    robot.connect()
    drive(robot, 0.5, 0.5)
    assert state(robot) is SupervisorState.DRIVING


def test_the_control_loop_counts_what_it_lost(robot: LibraryRobot) -> None:
    robot.step()
    before = control_counters(robot)
    robot.illegal = (3, 5)
    robot.now_us += 70_000
    robot.step()
    drive_against_the_limit(robot)
    counters = control_counters(robot)
    assert counters.late_steps == before.late_steps + 1
    assert counters.latest_step_us >= 70_000
    assert (counters.left_illegal, counters.right_illegal) == (3, 5)
    assert counters.saturated_steps > before.saturated_steps


def control_counters(robot: LibraryRobot) -> ControlCounters:
    answer = robot.request(ControlCountersGet(0, 0))
    assert isinstance(answer, ControlCounters)
    return answer


def drive_against_the_limit(robot: LibraryRobot) -> None:
    """Wheels that do not turn, for less than it takes to be a fault."""
    robot.request(ParameterSet(0, 0, PARAMETER_BY_NAME["max_duty"].id, 0.1))
    for _ in range(20):
        robot.set_velocity(0.4, 0.4)
        robot.step()


def test_the_active_values_can_be_read(robot: LibraryRobot) -> None:
    for name in ("control_rate_hz", "wheel_radius"):
        id_ = PARAMETER_BY_NAME[name].id
        assert robot.core.value(id_) == pytest.approx(parameter(robot, name))
    assert robot.core.value(0) == robot.core.value(255) == 0


def test_an_open_contact_is_an_estop_where_one_is_fitted() -> None:
    robot = LibraryRobot()
    assert robot.core.preset(PARAMETER_BY_NAME["estop_input_enabled"].id, 1) is RefusalCode.NONE
    robot.open()
    robot.contact_open = True
    assert robot.step().state is SupervisorState.ESTOPPED
    with pytest.raises(DeviceRefused) as refused:
        robot.request(ClearEstop(0, 0))
    assert refused.value.code == RefusalCode.CAUSE_PRESENT


def test_a_failed_pin_is_a_fault_for_good(robot: LibraryRobot) -> None:
    robot.core.fail()
    outputs = robot.step()
    assert outputs.state is SupervisorState.FAULT
    assert outputs.faults == Fault.DRIVER_FAILED


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


def test_a_chip_has_those_of_the_table() -> None:
    robot = LibraryRobot(board=Chip.SIMULATED).start()
    assert robot.outputs.period_us == 1_000


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


def test_what_was_saved_comes_back_and_precedes_presets() -> None:
    blocks: list[bytes] = []

    def save(block: bytes) -> bool:
        blocks.append(block)
        return True

    robot = LibraryRobot(save=save).open()
    radius = PARAMETER_BY_NAME["wheel_radius"].id
    robot.request(ParameterSet(0, 0, radius, 0.07))
    robot.request(ParameterSave(0, 0, 0))
    again = LibraryRobot(stored=blocks[-1])
    again.core.preset(radius, 0.05)
    again.open()
    assert parameter(again, "wheel_radius") == pytest.approx(0.07)
    robot.request(ParameterSet(0, 0, radius, 0.08))
    robot.request(ParameterSave(0, 0, PARAMETER_BY_NAME["max_duty"].id))
    kept = LibraryRobot(stored=blocks[-1]).open()
    assert parameter(kept, "wheel_radius") == pytest.approx(0.07)  # 0.08 was only tried
    robot.request(ParameterReset(0, 0))
    empty = LibraryRobot(stored=blocks[-1])
    empty.core.preset(radius, 0.05)
    assert parameter(empty.open(), "wheel_radius") == pytest.approx(0.05)
    robot.request(ParameterSave(0, 0, PARAMETER_BY_NAME["max_duty"].id))
    third = LibraryRobot(stored=blocks[-1]).open()
    assert parameter(third, "wheel_radius") == pytest.approx(0.033)


def test_a_store_that_fails_is_a_refusal() -> None:
    with pytest.raises(DeviceRefused) as refused:
        LibraryRobot(save=lambda _block: False).open().request(ParameterSave(0, 0, 0))
    assert refused.value.code == RefusalCode.STORE_FAILED


@pytest.mark.parametrize("block", [b"x", b"\0" * 5000])
def test_a_corrupt_block_leaves_the_defaults(block: bytes) -> None:
    robot = LibraryRobot(stored=block).open()
    assert parameter(robot, "wheel_radius") == pytest.approx(PARAMETERS[0].default)


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


def test_a_checkout_never_takes_an_installed_copy(
    unloaded: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    unloaded.setattr(native, "_PACKAGE", tmp_path / "installed")
    assert native.library_path().parent == native._CHECKOUT / "build" / "host"


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
