"""The device contract on the simulated robot."""

from __future__ import annotations

import pytest

from support.device_contract import Bench, DeviceContract
from wheelwire.simulation.simulator import Simulator


class TestSimulatedDevice(DeviceContract):
    @pytest.fixture
    def bench(self, simulator: Simulator) -> Bench:
        return Bench(simulator.port, reset=simulator.reset)
