"""range/PLACE and the words about range sensors and voltages: what is measured, nothing stale."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import Imu, Range

from support.cases import each
from support.range_board import ABOUT_M, simulator_on_board
from support.ros import Diagnostics, Graph, open_graph, wait
from support.ros_process import RobotNode
from support.ros_rig import silent, stamp_s
from wheelwire.simulation.simulator import Simulator


class Rig:
    """A node with a prefix of its frames, and what it publishes."""

    def __init__(self, graph: Graph, simulator: Simulator) -> None:
        self.graph = graph
        self.simulator = simulator
        self.diagnostics = Diagnostics(graph)
        self.front: deque[Any] = graph.listen(Range, "range/front")
        self.left: deque[Any] = graph.listen(Range, "range/left")
        self.imu: deque[Any] = graph.listen(Imu, "imu/data_raw")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    directory = tmp_path_factory.mktemp("rig")
    with (
        open_graph() as graph,
        simulator_on_board(link=directory / "port") as simulator,
        RobotNode(graph, port=simulator.port, tf_frame_prefix="robot1"),
    ):
        yield Rig(graph, simulator)


def test_a_range_is_in_its_frame_and_comes_once(rig: Rig) -> None:
    rig.simulator.set("range.left_m", 2.5)
    wait(lambda: rig.left and abs(rig.left[-1].range - 2.5) < ABOUT_M, "range/left")
    wait(lambda: len(rig.front) > 10, "range/front")
    message = rig.front[-1]
    assert message.range == pytest.approx(1.0, abs=ABOUT_M)
    assert message.header.frame_id == "robot1/range_front"
    assert rig.left[-1].header.frame_id == "robot1/range_left"
    assert message.radiation_type == Range.ULTRASOUND
    assert (message.min_range, message.max_range) == pytest.approx((0.02, 4.0))
    assert message.field_of_view == pytest.approx(0.26)
    stamps = [stamp_s(one) for one in tuple(rig.front)[-10:]]
    assert all(later > earlier for earlier, later in itertools.pairwise(stamps))
    assert 0 <= rig.graph.now_s() - stamps[-1] < 1


@each(("true_m", "distance_m"), [(10.0, math.inf), (0.01, -math.inf)])
def test_a_distance_that_cannot_be_measured_is_infinite(
    rig: Rig, true_m: float, distance_m: float
) -> None:
    rig.simulator.set("range.front_m", true_m)
    wait(lambda: rig.front and rig.front[-1].range == distance_m, "an infinite range")
    rig.diagnostics.wait("sensor range.front", lambda s, _: s.level == DiagnosticStatus.OK)
    rig.simulator.set("range.front_m", 1.0)
    wait(lambda: math.isfinite(rig.front[-1].range), "a finite range")


def test_a_stale_range_is_silent_and_says_why(rig: Rig) -> None:
    rig.simulator.set("range.hung", 1)
    told = rig.diagnostics.wait("sensor range.front", lambda _, v: v["reason"] == "HUNG")
    assert told["state"] == "STALE"
    with silent(rig.graph, rig.front, beside=rig.imu):
        rig.simulator.set("range.hung", 0)
    rig.diagnostics.wait("sensor range.front", lambda s, _: s.level == DiagnosticStatus.OK)


def test_a_voltage_is_in_the_diagnostics(rig: Rig) -> None:
    rig.simulator.set("analog.2_v", 3.0)
    told = rig.diagnostics.wait(
        "sensor analog_2", lambda _, v: "voltage_v" in v and abs(float(v["voltage_v"]) - 3) < 0.05
    )
    assert told["kind"] == "ANALOG"
