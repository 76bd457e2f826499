"""The device contract on the simulated robot."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.device_contract import Bench, DeviceContract
from wheelwire.sim import Simulator


class TestSimulatedDevice(DeviceContract):
    @pytest.fixture
    def bench(self) -> Iterator[Bench]:
        with Simulator() as simulator:
            yield Bench(simulator.port, reset=lambda: simulator.command("reset external"))
