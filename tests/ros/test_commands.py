"""Which commands are obeyed, and for how long. Each command says so by its age."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import TwistStamped

from support.ros import Repeater, wait
from support.ros_rig import Rig, open_rig, twist
from support.stop_host import stopped
from wheelwire_ros.commands import LOG_PERIOD_S

CMD_VEL_TIMEOUT_S = 0.5
CLOCK_ERROR_US = 10_000


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(
        tmp_path_factory.mktemp("rig"), stamped=True, cmd_vel_timeout=CMD_VEL_TIMEOUT_S
    ) as rig:
        yield rig


def test_what_is_stale_or_not_finite_is_ignored_and_counted(rig: Rig) -> None:
    ticks = rig.simulator.get("true.left_ticks")
    rig.commands.publish(rig.stamped(math.nan))
    assert rig.ignored("invalid") == 1
    rig.commands.publish(rig.stamped(0.3, age_s=CMD_VEL_TIMEOUT_S + 0.1))
    assert rig.ignored("stale") == 1
    assert rig.simulator.get("true.left_ticks") == ticks


def test_an_old_command_lives_for_the_rest_of_the_timeout(rig: Rig) -> None:
    age_s = 0.2
    rig.wait_past(0.3)  # a command older than the connection is ignored
    rig.simulator.take_states()
    rig.commands.publish(rig.stamped(0.3, age_s))
    start = rig.truth(lambda state: state.drive_on)
    rest_us = (CMD_VEL_TIMEOUT_S - age_s) * 1e6
    assert 0 < start.deadline_us - start.device_us <= rest_us + CLOCK_ERROR_US
    rig.truth(stopped)


@pytest.mark.parametrize("age_s", [-3600.0, None])
def test_no_stamp_means_now_and_one_from_the_future_gains_no_life(
    rig: Rig, age_s: float | None
) -> None:
    rig.simulator.take_states()
    message = TwistStamped(twist=twist(0.3)) if age_s is None else rig.stamped(0.3, age_s)
    rig.commands.publish(message)
    start = rig.truth(lambda state: state.drive_on)
    assert start.deadline_us - start.device_us <= CMD_VEL_TIMEOUT_S * 1e6 + CLOCK_ERROR_US
    rig.truth(stopped)


def test_stale_and_good_commands_together_do_not_flood_the_log(rig: Rig) -> None:
    before, start_s = rig.warnings("s old"), time.monotonic()
    with rig.driving_stamped(), Repeater(rig.commands, lambda: rig.stamped(0.3, age_s=0.6)):
        rig.truth(lambda state: state.drive_on)
        time.sleep(LOG_PERIOD_S)
        wait(lambda: rig.ignored("stale") > 100, "a hundred stale commands")
    periods = (time.monotonic() - start_s) // LOG_PERIOD_S
    assert rig.warnings("s old") <= before + 1 + periods
