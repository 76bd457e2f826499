"""Commands beside the node that holds the port: they look, stop and e-stop."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from std_srvs.srv import SetBool

from support.command import check_error, run
from support.ros import Graph
from support.ros_load import attached_estops
from support.ros_process import RobotNode
from support.ros_rig import NODE, open_rig
from support.stand_in import StandIn
from support.stop_host import stopped
from wheelwire import errors
from wheelwire.link.statistics import quantile
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import SupervisorState

AT_ONCE_S = 0.02


def test_an_estop_beside_the_node_stops_it_until_it_clears(tmp_path: Path) -> None:
    with open_rig(tmp_path) as rig:
        port = rig.simulator.port
        held = f"process {rig.node.process.pid}, which holds"
        with rig.driving():
            rig.truth(lambda state: state.drive_on)
            shown = run("monitor", port, "--seconds", "0.5", "--json")
            assert held in shown.stderr
            states = {json.loads(line)["state"] for line in shown.stdout.splitlines()}
            assert states == {"DRIVING"}
            done = run("estop", port)
            assert done.returncode == 0, done.stderr
            assert held in done.stderr
            rig.truth(stopped)
            # The node goes on commanding, and nothing comes of it.
            assert rig.truth(lambda _: True).state is SupervisorState.ESTOPPED
            line = check_error(run("clear", port), errors.PortUnavailable)
            assert f"process {rig.node.process.pid}" in line
        assert rig.graph.call(SetBool, f"{NODE}/estop", data=False).success
        rig.truth(lambda state: state.state is SupervisorState.IDLE)


def test_a_node_that_offers_nothing(tmp_path: Path) -> None:
    with open_rig(tmp_path, tap=False) as rig, rig.driving():
        rig.truth(lambda state: state.drive_on)
        line = check_error(run("estop", rig.simulator.port), errors.PortUnavailable)
        assert f"process {rig.node.process.pid}" in line
        assert line.partition(" (more: ")[0].endswith("Nothing was sent")
        rig.truth(lambda state: state.drive_on)


def test_an_estop_is_on_the_wire_at_once(graph: Graph) -> None:
    """`bench/ros.py` measures the tail of it."""
    with (
        Simulator(truth_hz=10.0) as simulator,
        closing(StandIn("support.wire_tap", simulator.port)) as tap,
        RobotNode(graph, port=tap.first_answer["port"]),
    ):
        graph.wait_active()
        found = attached_estops(graph, simulator, tap, (20, 1), listeners=1)
    assert quantile(found.written_s, 0.5) < AT_ONCE_S
