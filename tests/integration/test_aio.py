"""The driver for asyncio on the simulated robot: the firmware's core in real time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from support.simulator_on_line import simulator_on
from wheelwire import aio, errors
from wheelwire.samples import WheelSample
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import Fault, SupervisorEvent, SupervisorState

PATIENCE_S = 30.0


async def sample_that(
    robot: aio.Driver, condition: Callable[[WheelSample], bool], command: Callable[[], None]
) -> WheelSample:
    """The first sample that fulfils `condition`, the command given with each."""

    async def search() -> WheelSample:
        samples = robot.samples()
        while True:
            sample = await anext(samples)
            if condition(sample):
                return sample
            command()

    return await asyncio.wait_for(search(), PATIENCE_S)


def nothing() -> None:
    """No command."""


async def use_every_verb(simulator: Simulator) -> None:
    async with aio.open_driver("serial", port=simulator.port, connect_timeout=PATIENCE_S) as robot:

        def forward() -> None:
            robot.set_velocity(0.2, 0.0, ttl=0.5)

        def rest() -> None:
            robot.set_velocity(0.0, 0.0)

        def turn() -> None:
            robot.set_wheel_velocity(-0.15, 0.15, ttl=0.5)

        def push() -> None:
            robot.set_duty(0.5, -0.5, ttl=0.5)

        ticks = await robot.get_encoder_ticks()
        await sample_that(robot, lambda s: min(s.left_mps, s.right_mps) > 0.15, forward)
        assert (await robot.get_encoder_ticks()) > ticks
        await sample_that(robot, lambda s: s.left_mps < -0.1 < 0.1 < s.right_mps, turn)
        await sample_that(robot, lambda s: s.left_duty > 0.499 and s.right_duty < -0.499, push)
        forward()
        await sample_that(robot, lambda s: s.state is SupervisorState.TIMED_OUT, nothing)
        await sample_that(robot, lambda s: s.state is SupervisorState.DRIVING, forward)
        await robot.stop()
        await sample_that(robot, lambda s: s.state is SupervisorState.IDLE, nothing)

        await robot.estop()
        with pytest.raises(errors.DeviceRefused):
            await sample_that(robot, lambda _: False, forward)
        await robot.clear_estop()
        # A clear alone restarts nothing, and a bad line may lose any one setpoint of zero.
        await sample_that(robot, lambda s: s.state is SupervisorState.DRIVING, rest)
        simulator.set("left.encoder_dead", 1)
        with pytest.raises(errors.DeviceRefused):
            await sample_that(robot, lambda _: False, forward)
        sample = await sample_that(robot, lambda s: s.state is SupervisorState.FAULT, nothing)
        assert sample.faults & Fault.LEFT_NOT_COUNTING
        simulator.set("left.encoder_dead", 0)
        await robot.clear_fault()

        assert (await robot.device_counters()).frames_received > 0
        assert (await robot.control_counters()).left_illegal >= 0
        await robot.stop()  # what is recorded is read while nothing drives
        assert (await robot.recorder.ledger()).stops[SupervisorEvent.FAULT] == 1
        assert (await robot.recorder.read()).ledger is not None
        assert not await robot.contradictions()
        await robot.parameters.set("integral_gain", 7.5)
        await robot.parameters.save("integral_gain")
        simulator.reset()
        boot_id = sample.boot_id
        await sample_that(robot, lambda s: s.boot_id != boot_id, nothing)
        assert robot.parameters["integral_gain"] == 7.5
        assert robot.sessions >= 2  # one more where the computer stalled
        with pytest.raises(errors.DeviceRefused):
            await sample_that(robot, lambda _: False, forward)
        await sample_that(robot, lambda s: s.state is SupervisorState.DRIVING, rest)
        await sample_that(robot, lambda s: min(s.left_mps, s.right_mps) > 0.1, forward)


def test_every_verb() -> None:
    with simulator_on("split") as simulator:
        asyncio.run(use_every_verb(simulator))
        assert simulator.get("state") == SupervisorState.IDLE
