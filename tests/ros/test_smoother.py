"""A controller that dies behind Nav2's smoother: for how long the robot goes on obeying."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import TwistStamped

from support.nav2 import Command, Controller, Smoother, shipped
from support.ros import wait
from support.ros_rig import NODE, SPEED_MPS, open_rig, stamp_s
from support.stop_host import stopped

OBEYED_S = 0.55
BUSY_S = 0.2
"""By how much later a thread of this test may run, on a busy computer."""


def message(command: Command) -> Any:
    one = TwistStamped()
    seconds, rest_s = divmod(command.stamp_s, 1)
    one.header.stamp.sec, one.header.stamp.nanosec = int(seconds), int(rest_s * 1e9)
    one.twist.linear.x, one.twist.angular.z = command[:2]
    return one


class Periodic:
    """Calls something at a rate, in a thread, during a `with` block."""

    def __init__(self, period_s: float, call: Callable[[], None]) -> None:
        self._period_s, self._call = period_s, call
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        while not self._end.wait(self._period_s):
            self._call()

    def __enter__(self) -> Periodic:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()


def test_a_dead_controller_is_obeyed_no_longer_than_the_page_says(tmp_path: Path) -> None:
    with open_rig(tmp_path, stamped=True, publish_limited_velocity=True) as rig:
        obeyed = rig.graph.listen(TwistStamped, f"{NODE}/cmd_vel_out")
        smoother = Smoother(shipped("velocity_smoother"))
        controller = Controller(shipped("controller_server")["controller_frequency"])
        died_s: list[float] = []

        def now_s() -> float:
            return rig.graph.now_s()

        def control() -> None:
            command = controller.step(now_s())
            if command is not None and not died_s:
                smoother.command(command)

        def smooth() -> None:
            command = smoother.step(now_s())
            if command is not None:
                rig.commands.publish(message(command))

        controller.begin(SPEED_MPS, 0.0)
        with (
            Periodic(1 / controller.frequency_hz, control),
            Periodic(smoother.period_s, smooth),
        ):
            rig.truth(lambda state: state.left_mps > 0.9 * SPEED_MPS)
            died_s.append(now_s())
            rig.truth(stopped)
        seen_s = time.monotonic()
        wait(lambda: time.monotonic() - seen_s > 1.0, "a second without motion")
        moving = [stamp_s(one) for one in tuple(obeyed) if one.twist.linear.x]
        assert moving[-1] - died_s[0] < OBEYED_S + BUSY_S
        assert obeyed[-1].twist.linear.x == 0  # a zero ended it, not the robot's time-out
