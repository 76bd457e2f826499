"""Bumpers and cliff sensors at a computer's pins: pulls, levels, channels; and where buses are."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import pigpio
import pytest

from support.gpio_chip_process import GpioChip
from support.i2c_bus import I2cBuses
from support.pi_robot import IMU, POWER, board_with
from support.pigpio_process import PigpioProcess
from support.pin_drivers import l298n_on, pigpio_on
from support.waiting import wait_until
from wheelwire.board import DigitalInput, Pull
from wheelwire.drivers.pin_options import PigpioDriverOptions
from wheelwire.errors import ConfigurationError
from wheelwire.pi.settings import McuSettings
from wheelwire.robot.robot import Robot
from wheelwire_protocol.codes import PeripheralKind, Place, Reflex

BUMPER, CLIFF, STAGE = 8, 7, 25
BOARD = board_with(
    DigitalInput(PeripheralKind.BUMPER, Place.FRONT, BUMPER),
    DigitalInput(PeripheralKind.CLIFF, Place.NONE, CLIFF, pull=Pull.DOWN),
    DigitalInput(PeripheralKind.STAGE_FAULT, Place.NONE, STAGE, True, Pull.EXTERNAL),
)
FREE = {BUMPER: 0, CLIFF: 0, STAGE: 1}
PINS = replace(BOARD, peripherals=(POWER, *BOARD.peripherals))
"""What comes first is no input: their channels do not begin at 0."""
SetLevel = Callable[[int, int], None]


@contextmanager
def on_l298n(directory: Path) -> Iterator[tuple[Robot, SetLevel, Any]]:
    with GpioChip(directory, kernel_pwm=False) as chip:

        def set_level(gpio: int, level: int) -> None:
            chip.command(f"level {gpio} {level}")

        for gpio, level in FREE.items():
            set_level(gpio, level)
        chip.environment |= I2cBuses(directory / "i2c").environment(chip.environment["PYTHONPATH"])
        with l298n_on(chip, pins=PINS) as robot:
            for gpio, level in FREE.items():
                set_level(gpio, level)
            yield robot, set_level, chip.truth()["pulls"]


@contextmanager
def on_pigpio(directory: Path) -> Iterator[tuple[Robot, SetLevel, Any]]:
    with PigpioProcess() as daemon:
        client = pigpio.pi("127.0.0.1", daemon.port)
        thread = client._notify  # `stop` forgets it without waiting for its end

        def set_level(gpio: int, level: int) -> None:
            client.write(gpio, level)
            client.set_mode(gpio, pigpio.INPUT)

        for gpio, level in FREE.items():
            set_level(gpio, level)
        bus = I2cBuses(directory / "i2c").environment(os.pathsep.join(sys.path))
        with mock.patch.dict("os.environ", bus), pigpio_on(daemon, pins=PINS) as robot:
            yield robot, set_level, daemon.truth()["pulls"]
        client.stop()
        thread.join()


@pytest.mark.parametrize("place", [on_l298n, on_pigpio])
def test_each_input_is_its_channel_and_has_its_pull(place: Any, tmp_path: Path) -> None:
    with place(tmp_path) as (robot, set_level, pulls):
        assert (pulls[BUMPER], pulls[CLIFF]) == ("up", "down")
        assert pulls[STAGE] not in ("up", "down")
        seen = robot.inputs

        def is_triggered(name: str) -> bool:
            return bool(seen.read().triggered == (name,))

        for gpio, name, reflex in (
            (BUMPER, "bumper.front", Reflex.NO_FORWARD),
            (CLIFF, "cliff", Reflex.STOP),
            (STAGE, "stage_fault", Reflex.STOP),
        ):
            wait_until(lambda: not seen.read().triggered, 30, what="all are free")
            set_level(gpio, 1 - FREE[gpio])
            wait_until(partial(is_triggered, name), 30, what=name)
            assert seen.read().reflexes is reflex
            set_level(gpio, FREE[gpio])


def test_the_settings_survive_the_way_to_the_process() -> None:
    settings = McuSettings("l298n", replace(BOARD, peripherals=(*BOARD.peripherals, IMU, POWER)))
    assert McuSettings.from_json(settings.to_json()) == settings
    assert settings.buses == [1]
    assert McuSettings("l298n", BOARD).buses == []


def test_each_bus_is_named_once_in_order() -> None:
    board = board_with(replace(IMU, bus=3), POWER, replace(POWER, bus=3, address=0x41))
    assert McuSettings("l298n", board).buses == [1, 3]


def test_a_sensor_bus_cannot_be_on_another_computer() -> None:
    with pytest.raises(
        ConfigurationError, match=r"pigpio.host = 'robot.local': the pins are there"
    ):
        PigpioDriverOptions("robot.local", pins=board_with(IMU)).checked()
    assert PigpioDriverOptions("robot.local", pins=BOARD).checked().host == "robot.local"
    assert PigpioDriverOptions("127.0.0.1", pins=board_with(IMU)).checked().buses == [1]
