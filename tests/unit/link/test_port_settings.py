"""A port whose settings another program changes, and one that is held against other programs."""

import array
import fcntl
import os
import subprocess
import termios
from pathlib import Path

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link import transports as transport
from wheelwire.simulation.simulator import Simulator

TIOCGEXCL = 0x80045440
"""Linux's number; the module `termios` does not have it."""


def settings(port: Path | str) -> list[object]:
    file = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        return termios.tcgetattr(file)
    finally:
        os.close(file)


def stty(port: Path | str, *arguments: str) -> None:
    subprocess.run(["stty", "-F", str(port), *arguments], check=True)


def drives(driver: SerialDriver) -> bool:
    try:
        driver.set_velocity(0.1, 0.0)
        driver.stop()
    except (errors.LinkLost, errors.RequestTimeout):
        return False
    return True


@pytest.mark.parametrize("change", [["sane"], ["9600"], ["ixon", "ixoff"], ["-raw", "echo"]])
def test_the_link_comes_back_after_another_program_changed_the_settings(
    device: PtyDevice, change: list[str]
) -> None:
    with SerialDriver(str(device.path)) as driver:
        ours = settings(device.path)
        stty(device.path, *change)
        assert settings(device.path) != ours
        wait_until(lambda: settings(device.path) == ours)
        wait_until(lambda: drives(driver))
        assert driver.statistics.reconnects >= 1


def test_the_link_comes_back_at_the_devices_baud_rate() -> None:
    with Simulator(baud_rate=115_200) as simulator, SerialDriver(simulator.port) as driver:
        stty(simulator.port, "9600")
        wait_until(lambda: driver.statistics.reconnects >= 1)
        wait_until(lambda: drives(driver))
        assert driver.info.baud_rate == 115_200


def exclusive(port: Path) -> bool:
    file = os.open(port, os.O_RDWR | os.O_NOCTTY)  # root may do so
    try:
        flag = array.array("i", [0])
        fcntl.ioctl(file, TIOCGEXCL, flag)
        return bool(flag[0])
    finally:
        os.close(file)


def test_a_port_is_held_against_programs_that_know_no_lock(
    device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "PSEUDO_TERMINALS", "/nowhere/")
    with SerialDriver(str(device.path)):
        assert exclusive(device.path)
    assert not exclusive(device.path)


def test_a_pseudo_terminal_is_not_left_shut_by_a_program_that_is_killed(device: PtyDevice) -> None:
    with SerialDriver(str(device.path)):
        assert not exclusive(device.path)
