"""Exits with 0 if a robot's node reports in /diagnostics that it is connected to its robot.

Exits with 1 if the node is dead or hangs, or cannot reach its robot.

    healthcheck.py [NODE]      hardware_robot by default; with its namespace, /robot1/hardware_robot
"""

from __future__ import annotations

import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

TIMEOUT_S = 8.0
"""Long enough for discovery and one report, which comes every second."""


def main() -> str | None:
    """Run the check; returns what is wrong, or None."""
    robot = sys.argv[1].strip("/") if len(sys.argv) > 1 else "hardware_robot"
    of_link: list[DiagnosticStatus] = []

    def receive(report: DiagnosticArray) -> None:
        of_link.extend(status for status in report.status if status.name == f"{robot}: link")

    rclpy.init(args=[])
    # With as little of its own as possible: it comes and goes twice a minute, and each time all
    # other nodes discover what it has.
    node = rclpy.create_node("health_check", enable_rosout=False, start_parameter_services=False)
    node.create_subscription(DiagnosticArray, "/diagnostics", receive, 10)
    end = time.monotonic() + TIMEOUT_S
    while not of_link and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    rclpy.shutdown()
    if not of_link:
        return f"{robot} does not report: is the node running, under this name and namespace?"
    status = of_link[-1]
    return None if status.level == DiagnosticStatus.OK else f"{status.name}: {status.message}"


if __name__ == "__main__":
    sys.exit(main())
