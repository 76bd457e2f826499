"""What the library logs, as others on the graph get it from /rosout, and what the node says."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from rcl_interfaces.msg import Log

from support.ros import wait
from support.ros_rig import open_rig

LIBRARY = "hardware_robot.wheelwire"
LINE = "a line of the library"
TELLING = f"""
import logging, threading, time
from wheelwire_ros import hardware_robot

def tell():
    while True:
        logging.getLogger("wheelwire").warning("{LINE}")
        time.sleep(0.1)

threading.Thread(target=tell, daemon=True).start()
hardware_robot.main()
"""
"""The node, beside which the library has something to say."""


def test_the_librarys_records_reach_rosout_and_a_loss_and_a_return_are_one_line_each(
    tmp_path: Path,
) -> None:
    with open_rig(tmp_path, code=TELLING) as rig:
        records = rig.graph.listen(Log, "/rosout")

        def logged(name: str, level: int, text: str) -> bool:
            return any(
                (record.name, record.level) == (name, level) and text in record.msg
                for record in tuple(records)
            )

        wait(lambda: logged(LIBRARY, Log.WARN, LINE), "the library's line")
        wait(lambda: "is connected: session 1" in rig.node.errors(), "the first connection")
        rig.node.forget_errors()
        rig.simulator.unplug()
        wait(lambda: logged("hardware_robot", Log.ERROR, "the port is gone"), "the loss")
        rig.diagnostics.wait("link", lambda status, _: "the port is gone" in status.message)
        rig.simulator.plug()
        rig.diagnostics.wait("link", lambda status, _: status.message == "connected")
        wait(lambda: logged("hardware_robot", Log.INFO, "is connected: session 2"), "the return")
        wait(lambda: "is connected: session 2" in rig.node.errors(), "the line of the return")
        lines = [line for line in rig.node.errors().splitlines() if LINE not in line]
        # The second only where the robot takes its time to answer.
        texts = ("the port is gone", "has not answered yet", "is connected: session 2")
        told = [[text for text in texts if text in line] for line in lines]
        assert told in ([[texts[0]], [texts[2]]], [[text] for text in texts]), lines
