"""A port that leads to another board than the one that was met first."""

from pathlib import Path

import pytest

from support.core_device import CoreDevice
from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.types import SetDuty, SetWheelVelocity

STRANGER = 0x240AC4ABCDEF


def error_of(driver: SerialDriver) -> errors.WheelwireError | None:
    try:
        driver.set_velocity(0.0, 0.0)
    except errors.WheelwireError as error:
        return error
    return None


def test_a_driver_stays_with_the_board_that_it_met_first(device: PtyDevice) -> None:
    with SerialDriver(str(device.path)) as driver:
        stranger = device.replace(CoreDevice(board_id=STRANGER))
        wait_until(lambda: isinstance(error_of(driver), errors.WrongBoard))
        error = error_of(driver)
        assert "240ac4abcdef" in str(error)
        assert "240ac4123456" in str(error)
        assert "any_board" in str(error)
        with pytest.raises(errors.LinkLost):  # after what the first board had sent
            list(iter(lambda: driver.read(timeout=0.1), None))
        assert not [m for m in stranger.received if isinstance(m, (SetWheelVelocity, SetDuty))]
        assert driver.info.device.board_id == "240ac4123456"
        device.replace(CoreDevice())
        wait_until(lambda: error_of(driver) is None)


def test_the_port_of_a_wrong_board_is_left_to_others(device: PtyDevice) -> None:
    with SerialDriver(str(device.path)) as driver:
        device.replace(CoreDevice(board_id=STRANGER))
        wait_until(lambda: isinstance(error_of(driver), errors.WrongBoard))

        def open_second() -> bool:
            try:
                SerialDriver(str(device.path)).shutdown()
            except errors.PortUnavailable:
                return False
            return True

        wait_until(open_second)


def board_of(link: Path | None = None) -> str:
    with Simulator(link=link) as simulator, SerialDriver(simulator.port) as driver:
        return driver.info.device.board_id


def test_a_simulator_at_a_link_is_the_same_board_at_every_start(tmp_path: Path) -> None:
    first = board_of(link=tmp_path / "robot")
    assert board_of(link=tmp_path / "robot") == first
    assert board_of(link=tmp_path / "other") != first
    assert board_of() != board_of()
