"""battery_state: what the board measures, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState

from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import twist
from wheelwire import open_driver
from wheelwire.board import BatteryLevels, Peripheral, PowerSensor
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.board import Module
from wheelwire_protocol.sensors import SensorChip

VOLTS = 6.9
POWER = PowerSensor(SensorChip.INA219, sda=16, scl=17, shunt_mohm=100.0)


def test_a_broken_wire_is_no_voltage(graph: Graph, simulator: Simulator) -> None:
    """The board's list names a battery, and its divider reads 0 mV."""
    simulator.set("battery_v", 0.0)
    batteries = graph.listen(BatteryState, "battery_state")
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, port=simulator.port, battery_empty_v=6.0, battery_full_v=8.4):
        told = diagnostics.wait("sensor battery", lambda _, v: v["reason"] == "ZERO")
        assert told["state"] == "STALE"
        assert not batteries
        simulator.set("battery_v", VOLTS)
        wait(lambda: batteries, "battery_state")
    assert batteries[0].voltage == pytest.approx(VOLTS, abs=0.1)
    assert batteries[0].percentage == pytest.approx(0.375, abs=0.05)


def test_a_power_sensor_tells_the_current_and_the_boards_cells_a_percentage(
    graph: Graph, simulator: Simulator
) -> None:
    """So that Nav2's IsBatteryLow fires."""
    take_up(simulator, POWER, BatteryLevels(warn_v=7.0, limit_v=6.8, stop_v=6.6))  # cells: 2
    with RobotNode(graph, port=simulator.port):
        messages = graph.listen(BatteryState, "battery_state")
        commands = graph.publisher(Twist, "cmd_vel")
        with Repeater(commands, lambda: twist(0.3)):
            wait(lambda: messages and messages[-1].current < -0.02, "a current")
    message = messages[-1]
    assert message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    assert message.voltage == pytest.approx(7.4, abs=0.3)
    assert message.percentage == pytest.approx((message.voltage - 6.6) / 1.8, abs=0.001)


def test_a_board_without_divider_or_sensor_has_no_topic(graph: Graph, simulator: Simulator) -> None:
    simulator.set("battery_v", 0.0)
    take_up(simulator)
    with RobotNode(graph, port=simulator.port):
        graph.first(Odometry, "odom")
        topics = dict(graph.node.get_topic_names_and_types())
    assert "/odom" in topics
    assert not {"/battery_state", "/imu/data_raw", "/bumpers"} & set(topics)


def take_up(simulator: Simulator, *peripherals: Peripheral) -> None:
    """Write the simulated board with these peripherals."""
    with open_driver("serial", port=str(simulator.port)) as robot:
        robot.board.take_up(
            replace(load_board("l298n"), module=Module.WROOM_32, peripherals=peripherals)
        )
