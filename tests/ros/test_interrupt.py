"""Signals while the node starts or ends: it ends, whenever they come, and that is no failure."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from support.ros import TIMEOUT_S, Graph
from support.ros_process import RobotNode

CODE = """
import os, signal, threading
from wheelwire_ros.__main__ import main
threading.Timer({delay_s}, os.kill, [os.getpid(), signal.SIGINT]).start()
main()
"""
"""The moment counts from the beginning of the executable, whatever the computer is doing."""
MOMENTS_S = [0.02 + 0.13 * count for count in range(16)]
DRIVERS: tuple[dict[str, Any], ...] = ({"driver_type": "mock"}, {"port": "/dev/none"})


@pytest.mark.parametrize(("count", "delay_s"), list(enumerate(MOMENTS_S)))
def test_it_ends_at_once_and_cleanly(graph: Graph, count: int, delay_s: float) -> None:
    node = RobotNode(graph, CODE.format(delay_s=delay_s), **DRIVERS[count % 2])
    with node:
        assert node.process.wait(TIMEOUT_S) == 0
    assert "Traceback" not in node.errors_at_end


IGNORED = """
import os, signal, sys, weakref
from wheelwire_ros.__main__ import main

class Module:
    pass

class Finder:
    module = Module()

    def find_spec(self, name, path=None, target=None):
        if name == "wheelwire_ros.hardware_robot":
            self.reference = weakref.ref(Finder.module, interrupt)
            del Finder.module

def interrupt(_):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            pass
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise

sys.meta_path.insert(0, Finder())
main()
"""
"""Python ignores what a weak reference's callback raises, such as that of an import's lock."""


def test_it_ends_by_a_signal_whose_exception_python_ignores(graph: Graph) -> None:
    with RobotNode(graph, IGNORED, driver_type="mock") as node:
        assert node.process.wait(TIMEOUT_S) == 0
    assert "interrupted" in node.errors_at_end
    assert "Traceback" not in node.errors_at_end


TWICE = """
import os, signal, threading, time
from rclpy.signals import (
    SignalHandlerGuardCondition, SignalHandlerOptions, get_current_signal_handlers_options
)
from wheelwire_ros import hardware_robot

destroy = SignalHandlerGuardCondition.destroy

def checked_destroy(condition):
    if get_current_signal_handlers_options() != SignalHandlerOptions.NO:
        os._exit(3)  # rclpy's thread may be about to trigger it
    destroy(condition)

SignalHandlerGuardCondition.destroy = checked_destroy

def interrupt_twice():
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(os.getpid(), number)
        time.sleep({pause_s})

class Opening(hardware_robot.HardwareRobot):
    def open_driver(self):
        threading.Timer({delay_s}, interrupt_twice).start()
        return super().open_driver()

hardware_robot.HardwareRobot = Opening
hardware_robot.main()
"""
"""Ctrl-C, then the signal of an impatient launch file."""


@pytest.mark.parametrize("pause_s", [0.0, 0.02])
@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.4])
def test_a_second_signal_does_not_disturb_its_end(
    graph: Graph, delay_s: float, pause_s: float
) -> None:
    node = RobotNode(graph, TWICE.format(delay_s=delay_s, pause_s=pause_s), port="/dev/none")
    with node:
        assert node.process.wait(TIMEOUT_S) == 0
    assert "Traceback" not in node.errors_at_end
