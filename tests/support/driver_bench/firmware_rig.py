"""The firmware's core with its simulated counters, in virtual time.

The load of this computer does not affect it, as on a chip.
"""

from __future__ import annotations

from support.driver_bench.rig import PHASE_S, STOPS, TTL_S, Counting, Timing
from support.virtual import VirtualRobot

FULL_SPEED_TURNS_PER_S = 200 / 60
"""Speed of the model motor at full duty."""
LARGEST_COUNTS = 200_000
LARGEST_TPS = LARGEST_COUNTS * FULL_SPEED_TURNS_PER_S


def count(ticks_per_s: float) -> Counting:
    """Full speed, with encoders of as many ticks as needed."""
    counts = round(min(ticks_per_s / FULL_SPEED_TURNS_PER_S, LARGEST_COUNTS))
    robot = VirtualRobot(1, counts_per_revolution=counts).open()
    robot.set_parameter("counts_per_revolution", counts)
    before, true_before, start_us = _ticks(robot), _true(robot), robot.now_us
    robot.drive_duty(1.0, 1.0, 2.0)
    robot.stop()
    robot.run_until(lambda: bool(robot.sim.get("stands_still")))
    robot.run(0.1)  # the last samples arrive
    return Counting(
        asked_tps=ticks_per_s,
        true_ticks=_true(robot) - true_before,
        counted_ticks=_ticks(robot) - before,
        reported=0,
        seconds=(robot.now_us - start_us) / 1e6,
        cpu=0.0,
    )


def time_stops() -> Timing:
    """In the device's clock."""
    robot = VirtualRobot().open()
    late = []
    for index in range(STOPS):
        robot.set_duty(0.2, 0.2, ttl_s=TTL_S + index * PHASE_S)
        robot.run(TTL_S + STOPS * PHASE_S + 0.05)
        late.append(int(robot.sim.get("drive_removed_us") - robot.sim.get("deadline_us")))
    return Timing(late, 1000, 1000)


def _ticks(robot: VirtualRobot) -> int:
    return robot.sample.left_ticks + robot.sample.right_ticks


def _true(robot: VirtualRobot) -> int:
    return int(robot.sim.get("true.left_ticks") + robot.sim.get("true.right_ticks"))
