"""Setpoints that come too late are worth a line of the log where a line delays each of them."""

from __future__ import annotations

import logging

import pytest

from support.staged_stops import StagedRobot
from wheelwire_protocol.codes import SupervisorState

pytestmark = pytest.mark.timeout(60)


def test_a_line_that_delays_every_setpoint_is_reported_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    robot = StagedRobot()
    robot.open()
    robot.drive(0.2, 0.2, 0.3)
    robot.delay_us = 120_000
    with caplog.at_level(logging.WARNING, "wheelwire"):
        robot.drive(0.2, 0.2, 2.0, ttl_s=0.1)
    said = [one.getMessage() for one in caplog.records if "arrive too late" in one.getMessage()]
    assert len(said) == 1
    assert "longer ttl" in said[0]
    assert robot.session.setpoints.expired > 50


def test_some_that_come_too_late_are_not_worth_a_line(caplog: pytest.LogCaptureFixture) -> None:
    robot = StagedRobot()
    robot.open()
    robot.drive(0.2, 0.2, 0.3)
    with caplog.at_level(logging.WARNING, "wheelwire"):
        for _ in range(12):
            robot.delay_us = 120_000
            robot.drive(0.2, 0.2, 0.06, ttl_s=0.1)
            robot.delay_us = 0
            robot.run(0.15)  # frames in flight arrive first
            robot.drive(0.2, 0.2, 0.04, ttl_s=0.1)
    assert robot.session.setpoints.expired > 12
    assert robot.sample.state is SupervisorState.DRIVING
    assert "too late" not in caplog.text
