"""What a robot's driver knows to warn of: rolling, its board, an e-stop contact that is ignored."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

import pytest

from wheelwire.drivers.mock import MockDriver
from wheelwire.robot.verbs import CONTACT_IGNORED
from wheelwire_protocol.codes import ConfigurationState, RefusalCode


@pytest.fixture
def robot() -> Iterator[MockDriver]:
    with MockDriver(realtime=False) as robot:
        yield robot


def roll_away(robot: MockDriver) -> None:
    """On a slope, until that is known."""
    robot.simulator.set("slope_rad", math.radians(15))
    while robot.rolling_mps is None:
        assert robot.read().t_us < 10e6


def test_a_robot_that_rolls_away_is_logged_and_known_until_it_drives(
    robot: MockDriver, caplog: pytest.LogCaptureFixture
) -> None:
    robot.advance(2.0)
    assert robot.rolling_mps is None
    assert not caplog.records
    roll_away(robot)
    assert robot.rolling_mps is not None
    assert robot.rolling_mps >= robot.parameters["rolling_velocity_mps"]
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert f"rolls at {robot.rolling_mps:.2f} m/s" in record.getMessage()
    robot.advance(1.0)
    assert robot.rolling_mps is not None
    robot.set_velocity(0.0, 0.0)
    robot.advance(0.1)
    assert robot.rolling_mps is None


def test_a_board_that_nobody_confirmed_is_a_warning(robot: MockDriver) -> None:
    assert not robot.warnings
    robot.simulator.set("board_unwritten", 1)
    before = robot.read().boot_id
    robot.simulator.reset()
    while robot.read(3.0).boot_id == before:
        pass
    robot.advance(0.1)
    board = robot.info.board
    assert board is not None
    assert board.state is ConfigurationState.BUILT_IN
    assert list(robot.warnings) == [RefusalCode.BOARD_UNCONFIRMED.doc]


def test_an_estop_contact_that_is_ignored_is_a_warning_as_long_as_it_is(robot: MockDriver) -> None:
    robot.parameters.set("estop_input_enabled", 0)
    assert list(robot.warnings) == [CONTACT_IGNORED]
    robot.parameters.set("estop_input_enabled", 1)
    assert not robot.warnings
