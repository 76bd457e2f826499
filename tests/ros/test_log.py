"""What the library logs, as others on the graph get it from /rosout."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from rcl_interfaces.msg import Log

from support.ros import wait
from support.ros_rig import open_rig

LIBRARY = "hardware_robot.wheelwire"


def test_the_librarys_records_reach_rosout(tmp_path: Path) -> None:
    with open_rig(tmp_path) as rig:
        records = rig.graph.listen(Log, "/rosout")
        # Discovery of /rosout takes its time, and a record of before is not sent again.
        wait(lambda: rig.graph.node.count_publishers("/rosout") > 1, "the node's /rosout")

        def logged(level: int, text: str) -> bool:
            return any(
                (record.name, record.level) == (LIBRARY, level) and text in record.msg
                for record in tuple(records)
            )

        rig.simulator.unplug()
        wait(lambda: logged(Log.WARN, "the port is gone"), "the loss as a warning")
        rig.simulator.plug()
        wait(lambda: logged(Log.INFO, "link open"), "the new link as information")
