"""battery_state: what the board measures, and nothing else."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState

from support.ros import Graph
from support.ros_process import RobotNode
from wheelwire.simulation.simulator import Simulator

VOLTS = 6.9


def test_a_measured_voltage_is_all_that_is_told(graph: Graph, simulator: Simulator) -> None:
    simulator.set("battery_v", VOLTS)
    with RobotNode(graph, port=simulator.port):
        message = graph.first(BatteryState, "battery_state")
    assert message.voltage == pytest.approx(VOLTS, abs=0.1)
    assert message.present
    assert message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_UNKNOWN
    assert math.isnan(message.percentage)
    assert math.isnan(message.current)


@pytest.mark.parametrize(("volts", "share"), [(6.9, 0.375), (5.8, 0.0), (8.6, 1.0)])
def test_two_voltages_make_a_percentage(
    graph: Graph, simulator: Simulator, volts: float, share: float
) -> None:
    simulator.set("battery_v", volts)
    with RobotNode(graph, port=simulator.port, battery_empty_v=6.0, battery_full_v=8.4):
        message = graph.first(BatteryState, "battery_state")
    assert message.percentage == pytest.approx(share, abs=0.05)


def test_without_a_measurement_there_is_no_topic(graph: Graph, simulator: Simulator) -> None:
    simulator.set("battery_v", 0.0)
    with RobotNode(graph, port=simulator.port):
        graph.first(Odometry, "odom")
        topics = dict(graph.node.get_topic_names_and_types())
    assert "/odom" in topics
    assert "/battery_state" not in topics
