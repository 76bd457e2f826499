"""The mock driver, in virtual and in real time."""

import weakref

import pytest

from wheelwire.drivers.base import BaseDriver
from wheelwire.drivers.mock import MockDriver
from wheelwire.testing import Bench, DriverConformance


class MockBench(Bench):
    def __init__(self, realtime: bool) -> None:
        self.realtime = realtime

    def open(self) -> BaseDriver:
        driver = MockDriver(realtime=self.realtime)
        self.robot = driver.robot
        self._driver = weakref.ref(driver)
        return driver

    def pass_time(self, seconds: float) -> None:
        driver = self._driver()
        if self.realtime or driver is None:
            super().pass_time(seconds)
        else:
            driver.advance(seconds)

    def true_ticks(self) -> tuple[int, int]:
        return self.robot.true_ticks

    def is_driven(self) -> bool:
        return any(wheel.driven for wheel in self.robot.wheels)

    def lose_link(self) -> None:
        self.robot.link_lost = True

    def restore_link(self) -> None:
        self.robot.link_lost = False

    def block_left_encoder(self) -> None:
        self.robot.left.encoder.dead = True


class TestVirtualMock(DriverConformance):
    @pytest.fixture
    def bench(self) -> Bench:
        return MockBench(realtime=False)


class TestRealtimeMock(DriverConformance):
    @pytest.fixture
    def bench(self) -> Bench:
        return MockBench(realtime=True)
