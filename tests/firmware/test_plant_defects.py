"""What can be wired wrongly in a workshop: by the truth, and by what the firmware reports."""

from __future__ import annotations

from itertools import product

import pytest

from support.virtual import VirtualRobot
from wheelwire.samples import tick_difference


def reported(robot: VirtualRobot) -> tuple[int, int]:
    """The ticks of the newest state frame, signed."""
    sample = robot.sample
    return tick_difference(sample.left_ticks, 0), tick_difference(sample.right_ticks, 0)


def truth(robot: VirtualRobot, name: str) -> tuple[float, float]:
    """A reading of both wheels."""
    return robot.sim.get(f"true.left_{name}"), robot.sim.get(f"true.right_{name}")


def rest(robot: VirtualRobot) -> None:
    """Stop, stand still, and hear of it."""
    robot.stop()
    robot.run_until(lambda: bool(robot.sim.get("stands_still")))
    robot.run(0.05)


WIRING = (
    "motors_swapped",
    "encoders_swapped",
    "left.motor_reversed",
    "right.motor_reversed",
    "left.encoder_reversed",
    "right.encoder_reversed",
)


@pytest.mark.parametrize(
    "wired", list(product((0, 1), repeat=6)), ids=lambda w: "".join(map(str, w))
)
def test_each_of_64_wirings_moves_and_counts_as_it_is_wired(wired: tuple[int, ...]) -> None:
    wiring = dict(zip(WIRING, wired, strict=True))
    robot = VirtualRobot(wheels_free=1, **wiring).open()
    robot.drive_duty(0.3, 0.0, 0.04)
    robot.run(0.05)
    moved = wiring["motors_swapped"]
    side = ("left", "right")[moved]
    way = -1 if wiring[f"{side}.motor_reversed"] else 1
    turns = truth(robot, "turns")
    assert way * turns[moved] > 0.01
    assert turns[1 - moved] == 0.0
    counter = moved ^ wiring["encoders_swapped"]
    sign = -way if wiring[f"{side}.encoder_reversed"] else way
    assert sign * reported(robot)[counter] > 3
    assert reported(robot)[1 - counter] == 0


@pytest.mark.parametrize(
    "wired", list(product((0, 1), repeat=6)), ids=lambda w: "".join(map(str, w))
)
def test_parameters_undo_each_of_64_wirings(wired: tuple[int, ...]) -> None:
    wiring = dict(zip(WIRING, wired, strict=True))
    robot = VirtualRobot(wheels_free=1, **wiring).open()
    for variable, value in wiring.items():
        name = variable.replace(".", "_").replace("reversed", "inverted")
        robot.set_parameter(name, value)
    robot.drive_duty(0.3, -0.2, 0.2)
    left, right = truth(robot, "turns")
    assert left > 0.05
    assert right < -0.03
    rest(robot)
    assert reported(robot) == truth(robot, "ticks")


def test_a_flat_battery_holds_the_device_in_reset_until_it_is_changed() -> None:
    robot = VirtualRobot(brownout_v=5.5).open()
    boot_id = robot.sim.get("boot_id")
    robot.sim.set("supply_v", 5.0)
    robot.sim.advance(0.5)
    assert robot.sim.get("device_us") == 0.0
    assert robot.sim.get("boot_id") != boot_id
    boot_id = robot.sim.get("boot_id")
    robot.sim.set("supply_v", 7.4)
    robot.sim.advance(0.1)
    assert robot.sim.get("device_us") == pytest.approx(100_000, abs=200)
    assert robot.sim.get("boot_id") == boot_id  # one reset
