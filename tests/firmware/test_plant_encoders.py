"""From the wheel's edges through the chip's counter to the ticks that the host is reported."""

from __future__ import annotations

import pytest

from support.virtual import VirtualRobot
from wheelwire.samples import tick_difference

COUNTER_LIMIT = 32767
FINE = 100_000  # counts per revolution: a turn is three times round the counter


def reported(robot: VirtualRobot) -> tuple[int, int]:
    """The ticks of the newest state frame, signed."""
    robot.run(0.05)
    sample = robot.sample
    return tick_difference(sample.left_ticks, 0), tick_difference(sample.right_ticks, 0)


def true_ticks(robot: VirtualRobot) -> tuple[int, int]:
    return int(robot.sim.get("true.left_ticks")), int(robot.sim.get("true.right_ticks"))


def wait_for_rest(robot: VirtualRobot) -> None:
    robot.stop()
    robot.run_until(lambda: bool(robot.sim.get("stands_still")))


def test_ticks_are_exact_far_beyond_the_counter_both_ways() -> None:
    robot = VirtualRobot(counts_per_revolution=FINE).open()
    robot.drive_duty(0.6, -0.6, 4.0)
    wait_for_rest(robot)
    left, right = true_ticks(robot)
    assert left > 10 * COUNTER_LIMIT
    assert right < -10 * COUNTER_LIMIT
    assert reported(robot) == (left, right)


def test_ticks_are_exact_when_hovering_about_the_limit() -> None:
    robot = VirtualRobot(counts_per_revolution=FINE).open()
    robot.drive_duty(0.3, 0.3, 0.2)
    while true_ticks(robot)[0] < COUNTER_LIMIT:
        robot.drive_duty(0.3, 0.3, 0.02)
    crossings = 0
    above = True
    for _ in range(40):
        duty = -0.3 if true_ticks(robot)[0] > COUNTER_LIMIT else 0.3
        robot.drive_duty(duty, duty, 0.1)
        crossings += above != (true_ticks(robot)[0] > COUNTER_LIMIT)
        above = true_ticks(robot)[0] > COUNTER_LIMIT
    wait_for_rest(robot)
    assert crossings > 5
    assert reported(robot) == true_ticks(robot)


def test_uneven_edges_are_off_by_one_tick_at_most() -> None:
    robot = VirtualRobot(**{"left.encoder_error_ticks": 0.4}).open()
    robot.drive(0.3, 0.3, 5.0)
    wait_for_rest(robot)
    assert reported(robot)[0] == pytest.approx(true_ticks(robot)[0], abs=1)
