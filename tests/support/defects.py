"""Robots with one defect each, as the simulator has them, and the words for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wheelwire.tools.setup import problems

from .wiring_runs import set_up_raised


@dataclass(frozen=True)
class DefectiveRobot:
    """A robot with one defect."""

    defect: problems.Defect
    settings: Mapping[str, float]
    side: str = ""

    @property
    def name(self) -> str:
        """The words that a problem begins with."""
        return self.defect.name.format(side=self.side)


DEFECTS = (
    DefectiveRobot(problems.NO_ENCODER, {"left.encoder_dead": 1}, "left"),
    DefectiveRobot(problems.NO_ENCODER, {"right.encoder_dead": 1, "motors_swapped": 1}, "right"),
    DefectiveRobot(problems.NO_MOTOR, {"left.motor_open": 1}, "left"),
    DefectiveRobot(problems.NO_MOTOR, {"right.motor_open": 1, "encoders_swapped": 1}, "right"),
    DefectiveRobot(problems.CHANNEL_DEAD, {"left.stuck_channel": 1}, "left"),
    DefectiveRobot(problems.CHANNEL_DEAD, {"right.stuck_channel": 2}, "right"),
    DefectiveRobot(problems.SAME_ENCODER, {"encoders_same": 1}, "left"),
    DefectiveRobot(problems.SAME_ENCODER, {"encoders_same": 2, "motors_swapped": 1}, "right"),
    DefectiveRobot(problems.CHANNELS_MIXED, {"channels_mixed": 1}),
    DefectiveRobot(problems.NO_SUPPLY, {"supply_v": 0}),
    DefectiveRobot(problems.NO_SUPPLY, {"supply_v": 0, "battery_v": 0.5}),
    DefectiveRobot(problems.LOW_BATTERY, {"supply_v": 3, "battery_v": 3}),
    DefectiveRobot(problems.LOW_BATTERY, {"supply_v": 3, "battery_v": 3, "left.torque_scale": 0.4}),
    DefectiveRobot(problems.LOW_BATTERY, {"supply_v": 2.2, "battery_v": 2.2}),
    DefectiveRobot(problems.SAGS, {"supply_ohm": 2}),
    DefectiveRobot(problems.SAGS, {"supply_ohm": 6, "brownout_v": 5.5}),
    DefectiveRobot(problems.CONTACT_OPEN, {"estop_open": 1}),
    DefectiveRobot(problems.ON_THE_FLOOR, {"wheels_free": 0}),
    DefectiveRobot(problems.WEAK, {"left.torque_scale": 0.3}, "left"),
    DefectiveRobot(problems.WEAK, {"right.winding_scale": 3}, "right"),
    DefectiveRobot(problems.WEAK, {"right.motor_scale": 0.5}, "right"),
    DefectiveRobot(problems.WEAK, {"left.winding_scale": 7}, "left"),
    DefectiveRobot(problems.BLOCKED, {"left.blocked": 1}, "left"),
    DefectiveRobot(problems.MAGNET_MISSING, {"right.magnet_missing": 1}, "right"),
)


def named(robot: DefectiveRobot) -> str:
    """What a set-up of this robot says about it, and only that; empty if it says anything else."""
    found = set_up_raised(robot.settings).problems
    return found[0] if len(found) == 1 and found[0].startswith(robot.name) else ""
