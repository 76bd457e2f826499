"""A program that somebody stopped for long, on a robot that went on: it is not blind afterwards."""

from __future__ import annotations

import pytest

from support.core_device import UNHURRIED
from support.virtual import VirtualRobot
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

MINUTE_US = 60_000_000


@pytest.mark.parametrize("minutes", [37, pytest.param(70, marks=pytest.mark.whole)])
def test_a_program_that_was_stopped_has_fresh_samples_at_once(minutes: int) -> None:
    """Ctrl-Z: the host's clock goes on, and the line keeps what came at first."""
    robot = VirtualRobot(1)
    for name, value in UNHURRIED.items():
        robot.sim.preset(PARAMETER_BY_NAME[name].id, value)
    robot.sim.reset()
    robot.open()
    robot.run(1.0)
    robot.sim.advance_us(minutes * MINUTE_US)
    robot.now_us += minutes * MINUTE_US
    resumed_us = robot.now_us
    while robot.now_us < resumed_us + 5_000_000:
        robot.run(0.05)
    stamps = [sample.stamp * 1e6 for sample in robot.samples]
    fresh = [stamp for stamp in stamps if stamp > resumed_us]
    assert fresh
    assert fresh[0] - resumed_us < 4_500_000
    assert robot.now_us - stamps[-1] < 100_000
