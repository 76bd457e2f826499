"""Memory of the ROS node.

Two nodes at their defaults, each with a simulated robot, driven in curves by {COMMANDS_HZ:g}
commands a second with pauses, and an e-stop and its clear each minute. *Plain malloc* has one
arena, no cache per thread, and gives free memory back: `{PLAIN[GLIBC_TUNABLES]}`.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from statistics import linear_regression
from typing import TYPE_CHECKING, Any, NamedTuple

from harness import Report, end_without_ros, run

if find_spec("rclpy") is None:
    end_without_ros("Memory of the ROS node")
import rclpy  # noqa: F401 - it starts Python once more: before anything is printed
from geometry_msgs.msg import Twist
from std_srvs.srv import SetBool

from support.ros import Repeater, open_graph
from support.ros_process import RobotNode
from support.ros_rig import twist
from support.soak import resident_kib
from wheelwire.simulation.simulator import Simulator

if TYPE_CHECKING:
    from support.ros import Graph

COMMANDS_HZ = 20.0
TUNABLES = {"arena_max": 1, "tcache_count": 0, "trim_threshold": 65536, "mmap_threshold": 65536}
PLAIN = {"GLIBC_TUNABLES": ":".join(f"glibc.malloc.{name}={n}" for name, n in TUNABLES.items())}
VARIANTS: dict[str, dict[str, str]] = {"plain malloc": PLAIN, "defaults": {}}
SETTLED = 3
"""The first part of a run that this is the divisor of warms up: caches and buffers fill."""
GROWTH_KIB_PER_MIN = 5.0
"""Of plain malloc, after warming up, up to which it counts as constant."""
ROWS = 10


class Driven(NamedTuple):
    """A node that is commanded in curves."""

    pid: int
    estop: Any
    """A client of its e-stop."""

    def turn(self) -> int:
        """Its resident memory [KiB], after a minute; begins the next with an e-stop and a clear."""
        for is_set in (True, False):  # answers are not waited for, which a busy computer delays
            self.estop.call_async(SetBool.Request(data=is_set))
        return resident_kib(self.pid)


@contextmanager
def driven(graph: Graph, environment: dict[str, str], namespace: str) -> Iterator[Driven]:
    """A node with a simulated robot."""
    before = dict(os.environ)
    with ExitStack() as stack:
        simulator = stack.enter_context(Simulator())
        os.environ.update(environment)
        try:
            node = stack.enter_context(RobotNode(graph, namespace=namespace, port=simulator.port))
        finally:
            os.environ.clear()
            os.environ.update(before)
        estop = graph.node.create_client(SetBool, f"{namespace}/hardware_robot/estop")
        publisher = graph.publisher(Twist, f"{namespace}/cmd_vel")
        graph.wait_active(f"{namespace}/hardware_robot")
        stack.enter_context(Repeater(publisher, command, COMMANDS_HZ))
        yield Driven(node.process.pid, estop)


def command() -> Twist:
    """Left for 4 s, right for 4 s, each after a second of standstill, which arms after a clear."""
    turn, s = divmod(time.monotonic(), 5)
    return twist(0.2, 0.8 if turn % 2 else -0.8) if s > 1 else twist(0.0)


def show(report: Report, minutes: list[list[int]]) -> None:
    """The curve and its growth: for each minute the memory of each node."""
    report.table(
        f"after [min] | {' | '.join(f'{name} [MiB]' for name in VARIANTS)}",
        [
            f"{at} | " + " | ".join(f"{kib / 1024:.2f}" for kib in minutes[at - 1])
            for at in sorted({max(1, row * len(minutes) // ROWS) for row in range(1, ROWS + 1)})
        ],
    )
    settled = range(len(minutes) // SETTLED, len(minutes))
    for number, name in enumerate(VARIANTS):
        slope, _ = linear_regression(settled, [minutes[at][number] for at in settled])
        if number:
            report.target(f"growth, {name}", f"{slope:.1f} KiB/min", "", reached=True)
        else:
            report.at_most(f"growth, {name}", slope, GROWTH_KIB_PER_MIN, " KiB/min")


def main(report: Report, *, minutes: int = 90) -> None:
    """Measure at least 3 minutes and print."""
    found: list[list[int]] = []
    with open_graph() as graph, ExitStack() as stack:
        nodes = [
            stack.enter_context(driven(graph, environment, f"/{name.replace(' ', '_')}"))
            for name, environment in VARIANTS.items()
        ]
        begin_s = time.monotonic()
        for number in range(1, max(3, minutes) + 1):
            time.sleep(max(0.0, begin_s + 60 * number - time.monotonic()))
            found.append([node.turn() for node in nodes])
    show(report, found)


run(main)
