"""The pigpio driver: the real client library, and a daemon with a model robot behind its pins."""

from collections.abc import Iterator

import pytest

from support.pigpio_process import PigpioProcess
from wheelwire.drivers.pigpio import PigpioDriver
from wheelwire.robot.robot import Robot
from wheelwire.testing import Bench, DriverConformance


class PigpioBench(Bench):
    def __init__(self, daemon: PigpioProcess) -> None:
        self.daemon = daemon

    def open(self) -> Robot:
        # A busy test machine must not cause a fault.
        return PigpioDriver(
            "127.0.0.1",
            self.daemon.port,
            parameters={"overrun_limit_us": 1e6, "brake_time_s": 0.2, "stall_time_s": 2.0},
            core_timeout_ms=5000,
        )

    def true_ticks(self) -> tuple[int, int]:
        left, right = self.daemon.command("truth")["ticks"]
        return left, right

    def is_driven(self) -> bool:
        return bool(self.daemon.command("truth")["driven"])

    def lose_link(self) -> None:
        self.daemon.command("refuse")

    def restore_link(self) -> None:
        self.daemon.command("accept")

    def block_left_encoder(self) -> None:
        self.daemon.command("dead_left_encoder")


class TestPigpio(DriverConformance):
    @pytest.fixture
    def bench(self) -> Iterator[Bench]:
        with PigpioProcess() as daemon:
            yield PigpioBench(daemon)
