"""A set-up goes on after it has cleared an e-stop, also on a line that loses setpoints."""

from __future__ import annotations

import pytest

from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.errors import CommissioningFailed
from wheelwire.motion.kinematics import WheelVelocities
from wheelwire.tools.setup.driving import arm
from wheelwire.tools.setup.wiring import clear
from wheelwire_protocol.codes import SupervisorState


class LosingRobot(VirtualMockDriver):
    """Its first setpoints do not arrive, nor do their repeats."""

    to_lose = 0

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        self.to_lose -= 1
        if self.to_lose < 0:
            super()._drive_velocity(wheels, expiry_us)


@pytest.mark.parametrize("to_lose", [0, 1, 5])
def test_after_a_clear_the_robot_may_be_driven_at_once(to_lose: int) -> None:
    with LosingRobot(realtime=False) as robot:
        robot.estop()
        robot.to_lose = to_lose
        clear(robot)
        assert robot.to_lose < 0
        assert robot.simulator.get("true.distance_m") == 0.0
        # Some parameters change only while nothing is obeyed.
        robot.parameters.set("counts_per_revolution", 1000)
        robot.set_velocity(0.2, 0.0)
        robot.advance(0.1)
        assert robot.read().state is SupervisorState.DRIVING


def test_a_robot_that_no_setpoint_reaches_is_not_waited_for() -> None:
    with LosingRobot(realtime=False) as robot:
        robot.to_lose = 1_000_000
        with pytest.raises(CommissioningFailed, match="no setpoint reaches"):
            arm(robot)
