"""Commands beside the node that holds the port: they look, stop and e-stop."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from std_srvs.srv import SetBool

from support.command import check_error, run
from support.ros_rig import NODE, open_rig
from support.stop_host import stopped
from wheelwire import errors
from wheelwire_protocol.codes import SupervisorState


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
