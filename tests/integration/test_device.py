"""The device contract on the simulated robot, at the end of good lines and bad ones."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.device_contract import Bench, DeviceContract
from support.simulator_on_line import GOOD, simulator_on


class TestSimulatedDevice(DeviceContract):
    @pytest.fixture
    def bench(self, line: str) -> Iterator[Bench]:
        with simulator_on(line) as simulator:
            yield Bench(simulator.port, reset=simulator.reset, lossy=line != GOOD)
