"""Robots with one defect each, as the simulator has them, and the words for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from wheelwire.tools.setup.problems import (
    BLOCKED,
    CHANNEL_DEAD,
    CHANNELS_MIXED,
    CONTACT_OPEN,
    LOW_BATTERY,
    MAGNET_MISSING,
    NO_ENCODER,
    NO_MOTOR,
    NO_SUPPLY,
    ON_THE_FLOOR,
    SAGS,
    SAME_ENCODER,
    WEAK,
    Defect,
)

from .wiring_runs import set_up_raised


@dataclass(frozen=True)
class DefectiveRobot:
    """A robot with one defect."""

    defect: Defect
    settings: Mapping[str, float]
    side: str = ""

    @property
    def name(self) -> str:
        """The words that a problem begins with."""
        return self.defect.name.format(side=self.side)


DEFECTS = (
    DefectiveRobot(NO_ENCODER, {"left.encoder_dead": 1}, "left"),
    DefectiveRobot(NO_ENCODER, {"right.encoder_dead": 1, "motors_swapped": 1}, "right"),
    DefectiveRobot(NO_MOTOR, {"left.motor_open": 1}, "left"),
    DefectiveRobot(NO_MOTOR, {"right.motor_open": 1, "encoders_swapped": 1}, "right"),
    DefectiveRobot(CHANNEL_DEAD, {"left.stuck_channel": 1}, "left"),
    DefectiveRobot(CHANNEL_DEAD, {"right.stuck_channel": 2}, "right"),
    DefectiveRobot(SAME_ENCODER, {"encoders_same": 1}, "left"),
    DefectiveRobot(SAME_ENCODER, {"encoders_same": 2, "motors_swapped": 1}, "right"),
    DefectiveRobot(CHANNELS_MIXED, {"channels_mixed": 1}),
    DefectiveRobot(NO_SUPPLY, {"supply_v": 0}),
    DefectiveRobot(NO_SUPPLY, {"supply_v": 0, "battery_v": 0.5}),
    DefectiveRobot(LOW_BATTERY, {"supply_v": 3, "battery_v": 3}),
    DefectiveRobot(LOW_BATTERY, {"supply_v": 3, "battery_v": 3, "left.torque_scale": 0.4}),
    DefectiveRobot(LOW_BATTERY, {"supply_v": 2.2, "battery_v": 2.2}),
    DefectiveRobot(SAGS, {"supply_ohm": 2}),
    DefectiveRobot(SAGS, {"supply_ohm": 6, "brownout_v": 5.5}),
    DefectiveRobot(CONTACT_OPEN, {"estop_open": 1}),
    DefectiveRobot(ON_THE_FLOOR, {"wheels_free": 0}),
    DefectiveRobot(WEAK, {"left.torque_scale": 0.3}, "left"),
    DefectiveRobot(WEAK, {"right.winding_scale": 3}, "right"),
    DefectiveRobot(WEAK, {"right.motor_scale": 0.5}, "right"),
    DefectiveRobot(WEAK, {"left.winding_scale": 7}, "left"),
    DefectiveRobot(BLOCKED, {"left.blocked": 1}, "left"),
    DefectiveRobot(MAGNET_MISSING, {"right.magnet_missing": 1}, "right"),
)


def named(robot: DefectiveRobot) -> str:
    """What a set-up of this robot says about it, and only that; empty if it says anything else."""
    problems = set_up_raised(robot.settings).problems
    return problems[0] if len(problems) == 1 and problems[0].startswith(robot.name) else ""
