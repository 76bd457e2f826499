"""The device contract on a real board: docs/hardware-test.md."""

from __future__ import annotations

import time

import pytest
import serial

from support.device_contract import Bench, DeviceContract

RESET_PULSE_S = 0.1


def pulse_reset(port: str) -> None:
    """Pull EN by the automatic-reset circuit: RTS alone."""
    with serial.Serial(port) as line:
        line.dtr = False
        line.rts = True
        time.sleep(RESET_PULSE_S)
        line.rts = False


class TestRealDevice(DeviceContract):
    @pytest.fixture
    def bench(self, pytestconfig: pytest.Config) -> Bench:
        port = pytestconfig.getoption("--port")
        has_reset_line = port.startswith("/dev/")
        return Bench(
            port,
            reset=(lambda: pulse_reset(port)) if has_reset_line else None,
            wheels_free=pytestconfig.getoption("--wheels-free"),
        )
