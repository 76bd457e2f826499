"""A board with range sensors, an analogue input, and a gyroscope whose bias is known."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from wheelwire.board import AnalogInput, ImuSensor, RangeSensor
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.board import Module
from wheelwire_protocol.codes import Place
from wheelwire_protocol.peripherals import SensorChip

BIAS_RADPS = (0.1, -0.2, 0.05)
BOARD = replace(
    load_board("l298n"),
    module=Module.WROOM_32,
    led=None,
    peripherals=(
        ImuSensor(SensorChip.MPU6050, 16, 17, bias=BIAS_RADPS),
        RangeSensor(SensorChip.HC_SR04, Place.FRONT, 21, 34),
        RangeSensor(SensorChip.HC_SR04, Place.LEFT, 22, 35),
        AnalogInput(2, 36, 2.0),
    ),
)
NAMES = ["imu", "range.front", "range.left", "analog_2"]
FRONT, LEFT = "front", "left"
ABOUT_M = 0.01
"""How well the simulated echo tells a distance."""


@contextmanager
def simulator_on_board(**options: Any) -> Iterator[Simulator]:
    """A simulated robot on that board; `options` are the simulator's."""
    with Simulator(**options) as simulator:
        with SerialDriver(simulator.port) as robot:
            robot.board.take_up(BOARD)
        yield simulator
