"""Boards in a device, in virtual time: written, tried, kept or given up; and every power stage."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import cast

import pytest

from support.own_board import OWN_BOARD
from support.virtual import VirtualRobot
from wheelwire.board import Configuration, packed_entry
from wheelwire.errors import BoardMismatch, DeviceRefused, LinkLost
from wheelwire.link.info import ActiveBoard, ExpectedBoard
from wheelwire.link.session import Phase, Session
from wheelwire.tools.files.board import load_board, shipped_boards
from wheelwire_protocol.codec import BOARD, ENTRY, schema_hash
from wheelwire_protocol.codes import (
    Chip,
    ConfigurationState,
    Group,
    RefusalCode,
    ResetReason,
    SupervisorState,
)
from wheelwire_protocol.types import (
    BoardSet,
    ClearEstop,
    ConfigurationConfirm,
    ConfigurationGet,
    ConfigurationValue,
    ConfigurationWrite,
    GroupGet,
    GroupInfo,
    PeripheralSet,
    Restart,
)

OF_ESP32 = [name for name in shipped_boards() if load_board(name).chip is Chip.ESP32]
"""Those of the simulator's variable `wired_board`, in its order."""
INTERCHANGEABLE = {("l298n", "bts7960"), ("bts7960", "l298n"), ("tb6612", "mdd10a")}
"""Firmware's board, wired board: the same pins do the same, but for how the wheels coast."""


def stage(robot: VirtualRobot, board: Configuration) -> ConfigurationWrite:
    """Set the board and its peripherals; returns the message that stores them."""
    robot.request(BoardSet(0, 0, *BOARD.unpack_from(board.packed())))
    for channel, one in enumerate(board.peripherals):
        robot.request(PeripheralSet(0, 0, channel, *ENTRY.unpack(packed_entry(one))))
    return ConfigurationWrite(0, 0, len(board.peripherals), board.fingerprint())


def write(robot: VirtualRobot, board: Configuration) -> None:
    robot.request(stage(robot, board))


def in_force(robot: VirtualRobot) -> tuple[ConfigurationState, str]:
    """Where the board is from, and its name."""
    value = cast("ConfigurationValue", robot.request(ConfigurationGet(0, 0)))
    found = ActiveBoard.from_value(value)
    return found.state, found.name


def confirmation(board: Configuration) -> ConfigurationConfirm:
    """The message that confirms a board."""
    return ConfigurationConfirm(0, 0, board.fingerprint())


def restart(robot: VirtualRobot) -> None:
    """Restart by request; the session is open again."""
    boot = robot.sim.get("boot_id")
    robot.request(Restart(0, 0))
    robot.run_until(lambda: robot.sim.get("boot_id") != boot)
    robot.samples.clear()
    robot.run_until(lambda: bool(robot.samples))
    robot.arm()


def with_board(name: str, store: Path) -> VirtualRobot:
    """A robot that has kept a board, restarted, and drives with it."""
    robot = VirtualRobot(1, store, wheels_free=1).open()
    write(robot, load_board(name))
    restart(robot)
    robot.request(confirmation(load_board(name)))
    return robot


def unwritten(store: Path | None = None) -> VirtualRobot:
    """A fresh chip, whose board nobody has confirmed."""
    robot = VirtualRobot(1, store, wheels_free=1, board_unwritten=1)
    robot.sim.reset(ResetReason.POWER_ON)
    return robot.open()


def refused(robot: VirtualRobot, message: object) -> RefusalCode:
    with pytest.raises(DeviceRefused) as error:
        robot.request(message)  # type: ignore[arg-type]
    return RefusalCode(error.value.code)


def test_a_board_that_another_session_wrote_is_never_tried(tmp_path: Path) -> None:
    robot = with_board("drv8833", tmp_path / "store")
    write(robot, load_board("tb6612"))
    robot.session.connect(robot.now_us)  # another session, perhaps months later
    robot.samples.clear()
    robot.run_until(lambda: bool(robot.samples))
    restart(robot)
    assert in_force(robot) == (ConfigurationState.STORED, "DRV8833")


@pytest.mark.parametrize("by_contact", [True, False])
def test_no_board_is_a_way_around_an_estop(tmp_path: Path, by_contact: bool) -> None:
    robot = with_board("l298n", tmp_path / "store")
    if by_contact:
        robot.sim.set("estop_open", 1)
        robot.run(0.01)
        robot.sim.set("estop_open", 0)  # it is closed again, and still latched
    else:
        robot.estop()
    without_contact = Configuration(**{**load_board("l298n").__dict__, "estop": None})
    assert refused(robot, stage(robot, without_contact)) == RefusalCode.ESTOPPED
    assert refused(robot, confirmation(load_board("l298n"))) == RefusalCode.ESTOPPED
    restart(robot)  # allowed: what is latched survives it
    assert robot.state() is SupervisorState.ESTOPPED
    robot.request(ClearEstop(0, 0))
    write(robot, without_contact)
    robot.estop()
    assert refused(robot, Restart(0, 0)) == RefusalCode.ESTOPPED


def test_an_unconfirmed_boards_contact_counts_for_nothing() -> None:
    robot = unwritten()
    robot.sim.set("estop_open", 1)  # a fresh chip has nothing on that pin
    robot.run(0.1)
    assert robot.state() is SupervisorState.IDLE
    write(robot, load_board("l298n"))
    restart(robot)
    # Now there is a contact, and it is open.
    assert robot.state() is SupervisorState.ESTOPPED
    assert refused(robot, confirmation(load_board("l298n"))) == RefusalCode.ESTOPPED
    robot.sim.set("estop_open", 0)
    robot.request(ClearEstop(0, 0))
    robot.request(confirmation(load_board("l298n")))


def test_the_groups_of_a_device_have_their_hashes(robot: VirtualRobot) -> None:
    for group in Group:
        info = cast("GroupInfo", robot.request(GroupGet(0, 0, group)))
        served = 0 if group is Group.PLATFORM else schema_hash(group)  # not a chip
        assert (info.group, info.hash) == (group, served)
    assert cast("GroupInfo", robot.request(GroupGet(0, 0, 200))).hash == 0


def test_a_device_that_is_about_to_restart_does_not_drive() -> None:
    robot = VirtualRobot(wheels_free=1).open()
    robot.request(Restart(0, 0))
    robot.set_velocity(0.2, 0.2)
    robot.run(0.03)
    assert robot.sim.get("left.duty") == 0.0
    with pytest.raises(DeviceRefused, match="still starting"):
        robot.set_velocity(0.2, 0.2)


def test_a_board_of_another_chip_is_refused(robot: VirtualRobot) -> None:
    before = in_force(robot)
    for name in sorted({*shipped_boards()} - {*OF_ESP32}):
        assert refused(robot, stage(robot, load_board(name))) == RefusalCode.BOARD_REFUSED
    restart(robot)
    assert in_force(robot) == before


@pytest.mark.parametrize("name", OF_ESP32)
def test_every_board_drives_brakes_and_reverses(tmp_path: Path, name: str) -> None:
    robot = with_board(name, tmp_path / "store")
    for speed in (0.2, -0.2, 0.3):
        robot.drive(speed, speed, 1.0)
        assert robot.sample.left_mps == pytest.approx(speed, abs=0.04)
        assert robot.sample.right_mps == pytest.approx(speed, abs=0.04)
    robot.stop()
    robot.run(1.0)
    assert robot.sample.left_mps == robot.sample.right_mps == 0.0
    assert robot.sim.get("hard_switches") == 0


@pytest.mark.parametrize(
    ("name", "wired"), [(name, wired) for name in OF_ESP32 for wired in OF_ESP32 if name != wired]
)
def test_another_board_than_the_wired_one_is_noticed(tmp_path: Path, name: str, wired: str) -> None:
    robot = with_board(name, tmp_path / "store")
    robot.sim.set("wired_board", OF_ESP32.index(wired))
    restart(robot)
    followed = []
    with suppress(DeviceRefused):  # a fault, which is noticed, too
        for speed in (0.2, -0.2):
            robot.drive(speed, speed, 1.0)
            followed.append(abs(robot.sample.left_mps - speed) < 0.04)
    robot.stop()
    robot.run(0.005)
    # It does not follow both ways, or does not brake when it should.
    brakes = robot.sim.get("left.shorted") == 1.0
    as_told = followed == [True, True] and brakes and not robot.sample.faults
    assert as_told == ((name, wired) in INTERCHANGEABLE)


def test_a_device_that_comes_back_on_another_board_is_not_driven(tmp_path: Path) -> None:
    robot = VirtualRobot(1, tmp_path / "store", wheels_free=1)
    expected = ExpectedBoard(OWN_BOARD.name, OWN_BOARD.fingerprint(), is_bare=True)
    robot.session = Session(lambda: 1, expected_board=expected)
    robot.open()
    robot.drive(0.1, 0.1, 0.1)
    robot.stop()
    write(robot, load_board("tb6612"))
    robot.request(Restart(0, 0))
    robot.run_until(lambda: isinstance(robot.session.error, BoardMismatch))
    for _ in range(20):
        robot.run(0.1)
        with pytest.raises(LinkLost):
            robot.set_velocity(0.1, 0.1)
    assert "TB6612FNG, which is not confirmed, not L298N" in str(robot.session.error)
    # It was only on trial: the expected one returns, and drives.
    robot.run_until(lambda: robot.session.phase is Phase.OPEN, timeout_s=15.0)
    robot.arm()
    robot.drive(0.1, 0.1, 0.5)
    assert robot.sample.left_mps == pytest.approx(0.1, abs=0.03)


def test_the_session_knows_the_board_and_its_confirmation(tmp_path: Path) -> None:
    robot = VirtualRobot(1, tmp_path / "store").open()
    robot.run_until(lambda: robot.session.reported.board is not None)
    before = robot.session.reported.board
    assert before is not None
    assert (before.name, before.state) == (OWN_BOARD.name, ConfigurationState.STORED)
    assert (before.peripheral_count, before.has_contact) == (4, True)
    assert before.bare_fingerprint == OWN_BOARD.fingerprint() != before.fingerprint
    board = load_board("tb6612")
    write(robot, board)
    robot.request(Restart(0, 0))
    robot.run_until(lambda: robot.session.reported.board is None)  # of the session before
    robot.run_until(lambda: robot.session.reported.board is not None)
    fingerprint = board.fingerprint()
    on_trial = ActiveBoard(
        board.name, ConfigurationState.TRIAL, fingerprint, True, 0, bare_fingerprint=fingerprint
    )
    assert robot.session.reported.board == on_trial
    robot.run_until(lambda: robot.session.phase is Phase.OPEN)
    robot.request(confirmation(board))
    assert robot.session.reported.board == on_trial._replace(state=ConfigurationState.STORED)
