"""What the drivers for asyncio have in common is judged with `serial`; here, what each opens."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.gpio_chip_process import GpioChip
from support.pigpio_process import PigpioProcess
from wheelwire import aio, errors
from wheelwire_protocol.codes import Chip, SupervisorState

PATIENCE_S = 30.0
PARAMETERS = {"overrun_limit_us": 1e6, "brake_time_s": 0.2}
"""A busy test machine must not cause a fault."""


@pytest.fixture
def chip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[GpioChip]:
    with GpioChip(tmp_path) as chip:
        for name, value in chip.environment.items():
            monkeypatch.setenv(name, value)
        yield chip


async def drive(robot: aio.Driver) -> None:
    """Until both wheels turn; then stop, until they stand."""
    sample = await robot.read(PATIENCE_S)
    while min(sample.left_mps, sample.right_mps) < 0.1:
        robot.set_velocity(0.2, 0.0, ttl=0.5)
        sample = await robot.read(PATIENCE_S)
    await robot.stop()
    while sample.state is not SupervisorState.IDLE or sample.left_mps or sample.right_mps:
        sample = await robot.read(PATIENCE_S)


async def test_pins(chip: GpioChip) -> None:
    opening = aio.open_driver(
        "l298n",
        parameters=PARAMETERS,
        pwm_directory=Path(chip.pwm_directory),
        core_timeout_ms=5000,
    )
    async with opening as robot:
        assert isinstance(robot.limits, tuple)
        await drive(robot)
        robot.set_velocity(0.2, 0.0, ttl=0.5)
    assert not chip.truth()["driven"]


async def test_a_pigpio_daemon() -> None:
    with PigpioProcess() as daemon:
        opening = aio.open_driver(
            "pigpio",
            host="127.0.0.1",
            port=daemon.port,
            parameters=PARAMETERS,
            core_timeout_ms=5000,
        )
        async with opening as robot:
            await drive(robot)
            robot.set_velocity(0.2, 0.0, ttl=0.5)
        assert not daemon.command("truth")["driven"]


async def test_a_simulated_robot_and_its_loss() -> None:
    async with aio.open_driver("mock", parameters=PARAMETERS) as robot:
        assert robot.info.device.board is Chip.SIMULATED
        await drive(robot)
        assert robot.simulator.get("true.distance_m") > 0
        first = robot.sessions
        robot.unplug()
        robot.plug()
        while robot.sessions == first:
            await robot.read(PATIENCE_S)
        # The simulator was restarted, so its robot is held.
        with pytest.raises(errors.DeviceRefused):
            robot.set_velocity(0.2, 0.0, ttl=0.5)
        robot.set_velocity(0.0, 0.0)
        await drive(robot)


def test_the_drivers_leave_no_process_behind(chip: GpioChip) -> None:
    async def use(name: str, **options: Any) -> None:
        for _ in range(2):
            async with aio.open_driver(name, **options) as robot:
                await robot.read(PATIENCE_S)

    directory = Path(chip.pwm_directory)
    asyncio.run(use("l298n", pwm_directory=directory, core_timeout_ms=5000))  # the pins are free
