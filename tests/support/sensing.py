"""A host of firmware in virtual time that watches the firmware's sensors."""

from __future__ import annotations

import pytest

from support.raw import RawHost
from wheelwire_protocol.codes import SensorEventCode, SensorState
from wheelwire_protocol.types import SensorEvent, SetWheelVelocity


class SensingHost(RawHost):
    """Drives, and waits for what a sensor's channel says of itself."""

    commands = 0

    def ms_until(self, state: SensorState, channel: int = 0) -> float:
        """Lets time pass until the device says so; how long it took by its clock."""
        self.received.clear()
        start_us = self.device_us
        for _ in range(5000):
            self.run_ms(1)
            for event in self.of(SensorEvent):
                found = (event.channel, event.code, event.value)
                if found == (channel, SensorEventCode.STATE, state):
                    return (event.t_us - start_us) / 1e3
        pytest.fail(f"it never was {state.name}: {self.of(SensorEvent)}")

    def drive(self, left_mps: float, right_mps: float, milliseconds: int) -> None:
        """Command 50 times a second."""
        for _ in range(milliseconds // 20):
            self.commands += 1
            expiry_us = (self.device_us + 500_000) % 2**32
            self.send(
                SetWheelVelocity(self.session_id, self.commands, expiry_us, left_mps, right_mps)
            )
            self.run_ms(20)
