"""Whatever ends the driving, the drive is removed: read from the plant, in the device's clock."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from lifecycle_msgs.msg import Transition
from std_msgs.msg import Empty

from support.ros import TIMEOUT_S
from support.ros_rig import NODE, Rig, open_rig
from support.stop_host import stopped
from support.stop_times import PERIOD_US
from wheelwire.simulation.simulator import TrueState

CMD_VEL_TIMEOUT_S = 0.5
LONG_S = 5.0
CLOCK_ERROR_US = 10_000

EXPLOSIVE = """
import time
from std_msgs.msg import Empty
from wheelwire_ros import hardware_robot, motion_estimator

def explode(*_):
    raise RuntimeError("a defect")

class Explosive(hardware_robot.HardwareRobot):
    def __init__(self, *args):
        super().__init__(*args)
        self.create_subscription(Empty, "explode_here", explode, 1)
        self.create_subscription(Empty, "explode_reading", self.explode_reading, 1)

    def explode_reading(self, _):
        motion_estimator.MotionEstimator.update = explode
        time.sleep(3)  # past the instant by which the thread of the samples has to stop the wheels

hardware_robot.HardwareRobot = Explosive
hardware_robot.main()
"""


def check_stopped_at_deadline(end: TrueState) -> None:
    assert 0 <= end.drive_removed_us - end.deadline_us <= PERIOD_US


def check_stopped_early(rig: Rig) -> None:
    """Not by the deadline, which is far away."""
    end = rig.truth(stopped)
    assert end.deadline_us - end.drive_removed_us > LONG_S / 2 * 1e6


def test_a_command_lives_for_the_timeout_and_nothing_sends_it_again(tmp_path: Path) -> None:
    """Also if the node is killed."""
    with open_rig(tmp_path, cmd_vel_timeout=CMD_VEL_TIMEOUT_S) as rig:
        start = rig.drive_on()
        end = rig.truth(stopped)
        check_stopped_at_deadline(end)
        assert end.deadline_us <= start.device_us + CMD_VEL_TIMEOUT_S * 1e6 + CLOCK_ERROR_US
        with rig.driving():
            rig.truth(lambda state: state.drive_on)
            rig.node.end(signal.SIGKILL)
            check_stopped_at_deadline(rig.truth(stopped))


@pytest.fixture
def far_rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Rig]:
    """A command acts for long enough to tell a stop from a time-out."""
    code = getattr(request, "param", None)
    with open_rig(tmp_path, code=code, cmd_vel_timeout=LONG_S, ttl_max_s=LONG_S) as rig:
        yield rig


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_node_stops_the_wheels_first(far_rig: Rig, number: signal.Signals) -> None:
    far_rig.drive_on()
    far_rig.node.process.send_signal(number)
    check_stopped_early(far_rig)
    assert far_rig.node.process.wait(TIMEOUT_S) == 0
    assert "Traceback" not in far_rig.node.errors()


@pytest.mark.parametrize("far_rig", [EXPLOSIVE], indirect=True)
@pytest.mark.parametrize("topic", ["explode_here", "explode_reading"])
def test_an_exception_in_either_thread_stops_the_wheels_first(far_rig: Rig, topic: str) -> None:
    explosion = far_rig.graph.publisher(Empty, topic)
    far_rig.drive_on()
    explosion.publish(Empty())
    check_stopped_early(far_rig)
    assert far_rig.node.process.wait(TIMEOUT_S) == 1
    assert "RuntimeError: a defect" in far_rig.node.errors()


def test_when_a_transition_out_of_active_is_answered_the_wheels_have_stopped(far_rig: Rig) -> None:
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVE_SHUTDOWN):
        far_rig.drive_on()
        assert far_rig.graph.change_state(NODE, transition)
        assert not far_rig.simulator.get("drive_on")
        check_stopped_early(far_rig)
        far_rig.graph.change_state(NODE, Transition.TRANSITION_ACTIVATE)
