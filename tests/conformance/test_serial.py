"""The serial driver, with the simulated ESP32 behind a pseudo-terminal."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.aio_driver import AioDriver
from wheelwire import aio
from wheelwire.drivers.serial import SerialDriver
from wheelwire.robot.robot import Robot
from wheelwire.simulation.simulator import Simulator
from wheelwire.testing import Bench, DriverConformance


class SerialBench(Bench):
    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator

    def open(self) -> Robot:
        return SerialDriver(self.simulator.port)

    def true_ticks(self) -> tuple[int, int]:
        left = int(self.simulator.get("true.left_ticks"))
        return left, int(self.simulator.get("true.right_ticks"))

    def is_driven(self) -> bool:
        return bool(self.simulator.get("drive_on"))

    def lose_link(self) -> None:
        self.simulator.unplug()

    def restore_link(self) -> None:
        self.simulator.plug()

    def block_left_encoder(self) -> None:
        self.simulator.set("left.encoder_dead", 1)


class AioSerialBench(SerialBench):
    def open(self) -> Robot:
        return AioDriver(aio.open_driver("serial", port=self.simulator.port))


class TestSerial(DriverConformance):
    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[Bench]:
        with Simulator(link=tmp_path / "robot", seed=1) as simulator:
            yield SerialBench(simulator)


class TestSerialOnAsyncio(DriverConformance):
    @pytest.fixture
    def bench(self, tmp_path: Path) -> Iterator[Bench]:
        with Simulator(link=tmp_path / "robot", seed=1) as simulator:
            yield AioSerialBench(simulator)
