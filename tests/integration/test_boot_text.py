"""The driver against the real firmware on a bad line, whose chip speaks as it starts."""

from __future__ import annotations

from support.simulator_on_line import simulator_on
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire_protocol.codes import ResetReason

TIMEOUT_S = 30.0


def test_the_roms_boot_text_is_survived() -> None:
    with (
        simulator_on("noisy", settings={"boot_text": 1}) as simulator,
        SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot,
    ):
        boot_id = simulator.reset(ResetReason.BROWNOUT)
        wait_until(lambda: robot.read(TIMEOUT_S).boot_id == boot_id)
        assert robot.info.device.reset_reason is ResetReason.BROWNOUT
        assert robot.statistics.device_resets == 1
