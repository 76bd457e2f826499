"""The mock driver, in virtual and in real time."""

import weakref

import pytest

from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import WheelwireError
from wheelwire.robot.robot import Robot
from wheelwire.testing import Bench, DriverConformance


class MockBench(Bench):
    def __init__(self, realtime: bool) -> None:
        self.realtime = realtime

    def open(self) -> Robot:
        # A busy test machine must not cause a fault.
        driver = MockDriver(
            realtime=self.realtime, parameters={"overrun_limit_us": 1e6, "brake_time_s": 0.2}
        )
        self.simulator = driver.simulator
        self._reference = weakref.ref(driver)
        return driver

    @property
    def driver(self) -> MockDriver:
        driver = self._reference()
        assert driver
        return driver

    def pass_time(self, seconds: float) -> None:
        if self.realtime:
            super().pass_time(seconds)
        else:
            self.driver.advance(seconds)

    def true_ticks(self) -> tuple[int, int]:
        left, right = (int(self.simulator.get(f"true.{side}_ticks")) for side in ("left", "right"))
        return left, right

    def is_driven(self) -> bool:
        try:
            return bool(self.simulator.get("drive_on"))
        except WheelwireError:  # with the simulator ends the robot
            return False

    def lose_link(self) -> None:
        self.driver.unplug()

    def restore_link(self) -> None:
        self.driver.plug()

    def block_left_encoder(self) -> None:
        self.simulator.set("left.encoder_dead", 1)


class TestVirtualMock(DriverConformance):
    @pytest.fixture
    def bench(self) -> Bench:
        return MockBench(realtime=False)


class TestRealtimeMock(DriverConformance):
    @pytest.fixture
    def bench(self) -> Bench:
        return MockBench(realtime=True)
