"""The ROS node.

Client, node and peer are processes on loopback (Fast DDS); the robot is a simulator with 200 states
a second. The peer is a bare rclpy node that publishes the same four messages by a timer, at 50 Hz.
Latency: from publishing `cmd_vel` to the setpoint on the node's port, or to the peer's callback.
{MEASURED} interleaved rounds of {COMMANDS} commands, 100 a second.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import closing, contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

from harness import Report, end_without_ros, run
from support.stand_in import StandIn
from wheelwire.link.statistics import quantile
from wheelwire.simulation.simulator import Simulator

if find_spec("rclpy") is None:
    end_without_ros("The ROS node")
import rclpy  # noqa: F401 - it starts Python once more: before anything is printed

from support.ros import open_graph
from support.ros_load import (
    Commander,
    RobotCommander,
    attached_estops,
    bare_node,
    latencies_to_the_motors,
    watch,
)
from support.ros_process import RobotNode

if TYPE_CHECKING:
    from support.ros import Graph
    from support.ros_load import Stream

MEASURED = 10
COMMANDS = 80
RATES_HZ = (50.0, 100.0, 200.0)
MOTORS_HZ = 200.0
MOTORS_COUNT = 300
MOTORS = """\
From publishing `cmd_vel`, or calling `~/estop`, until the motors react, with control steps of 1 ms.
In ms: p50, p99, then both while another client sets, lists and saves parameters without pause."""
BESIDE_LIMIT_MS = 20.0
COMMAND_TIMES = 2.0
"""The 99th percentile of a command's latency at most, as a multiple of the peer's."""
ESTOP_TIMES = 4.0
"""The same for an e-stop: it also crosses the link, and waits for a control step."""
CPU_TIMES, CPU_AT_HZ = 1.5, 100.0
"""The node's CPU at most, as a multiple of the peer's; and at which rate."""
BESIDE = """\
E-stops by attached programs while the node drives: from the write to the node's tap, or from the
start of `wheelwire estop`, to the node's port ({} and {} e-stops). In ms: p50,
p99, then both with 2 further attached programs."""
BESIDE_COUNTS = (300, 30)
STREAMS = """\
Jitter, of arrivals in another process and of stamps: the 99th percentile of the interval's
deviation from the period. CPU is of one core: also of the link, the log of stops and
diagnostics, which the peer has not."""


@contextmanager
def tapped_node() -> Iterator[tuple[Graph, Simulator, StandIn]]:
    """A node whose port's other end is listened to."""
    with (
        open_graph() as graph,
        Simulator(truth_hz=10.0) as simulator,
        closing(StandIn("support.wire_tap", simulator.port)) as tap,
        RobotNode(graph, port=tap.first_answer["port"], publish_rate=MOTORS_HZ),
    ):
        graph.wait_active()
        yield graph, simulator, tap


def ms(latencies_s: list[float]) -> tuple[float, float]:
    """Median and 99th percentile in milliseconds."""
    return quantile(latencies_s, 0.5) * 1e3, quantile(latencies_s, 0.99) * 1e3


def show_latency(report: Report) -> None:
    """The latency of commands."""
    with tapped_node() as (graph, _, tap), bare_node(graph, report.scratch / "bare", 50.0) as bare:
        commanders: dict[str, Commander | RobotCommander] = {
            "cmd_vel to the setpoint on the wire": RobotCommander(graph, tap),
            "the peer: to its callback": Commander(graph, "bare_cmd_vel", report.scratch / "bare"),
        }
        # Alternate, so that a slow moment of the computer affects both. The first ones warm up.
        for _ in range(1 + MEASURED):
            for commander in commanders.values():
                commander.send(COMMANDS)
        # The peer writes down what it heard when it ends.
        bare.end(signal.SIGINT)
        found = {name: c.latencies_s(skipped=COMMANDS) for name, c in commanders.items()}
    (p50, p99), (peer_p50, peer_p99) = map(ms, found.values())
    ours, theirs = found
    report.table(
        "latency [ms] | p50 | p99 | p50 / peer's | p99 / peer's",
        [
            f"{ours} | {p50:.2f} | {p99:.2f} | {p50 / peer_p50:.2f} | {p99 / peer_p99:.2f}",
            f"{theirs} | {peer_p50:.2f} | {peer_p99:.2f} | 1.00 | 1.00",
        ],
    )
    report.at_most("p99 of a command / the peer's", p99 / peer_p99, COMMAND_TIMES)


def show_motors(report: Report) -> None:
    """The latency of commands and e-stops."""
    names = ("command", "e-stop", "the peer's service")
    cells: dict[str, list[str]] = {name: [] for name in names}
    with (
        open_graph() as graph,
        Simulator(truth_hz=10.0) as simulator,
        RobotNode(graph, port=simulator.port, publish_rate=MOTORS_HZ),
    ):
        for flooded, beside in ((False, ""), (True, " beside other calls")):
            found = latencies_to_the_motors(
                graph, simulator, MOTORS_COUNT, report.scratch / "called", flooded=flooded
            )
            for name, (p50, p99) in zip(names, map(ms, found), strict=True):
                cells[name].append(f"{p50:.2f} | {p99:.2f}")
            times = ms(found.estops_s)[1] / ms(found.peer_s)[1]
            report.at_most(f"p99 of an e-stop / the peer's service{beside}", times, ESTOP_TIMES)
    report.say(MOTORS)
    report.items(_joined(cells))


def show_attached(report: Report) -> None:
    """The latency of e-stops while the node runs."""
    begins = [f"from {of}" for of in ("the write", "the command's start")]
    cells: dict[str, list[str]] = {begin: [] for begin in begins}
    with tapped_node() as (graph, simulator, tap):
        for listeners in (0, 2):
            found = attached_estops(graph, simulator, tap, BESIDE_COUNTS, listeners)
            beside = f", {listeners} listeners" if listeners else ""
            for begin, (p50, p99) in zip(begins, map(ms, found), strict=True):
                cells[begin].append(f"{p50:.2f} | {p99:.2f}")
            what = f"p99 of an e-stop beside the node{beside}"
            report.at_most(what, ms(found.written_s)[1], BESIDE_LIMIT_MS, " ms")
    report.say(BESIDE.format(*BESIDE_COUNTS))
    report.items(_joined(cells))


def _joined(cells: dict[str, list[str]]) -> list[str]:
    return [" | ".join([name, *of]) for name, of in cells.items()]


def show_streams(report: Report) -> None:
    """Rates, jitter and CPU."""
    rows = []
    for rate_hz in RATES_HZ:
        with open_graph() as graph:
            # One after the other: at once, each would take processor time from the other.
            with (
                Simulator() as simulator,
                RobotNode(graph, port=simulator.port, publish_rate=rate_hz) as node,
            ):
                ours = watch(graph, "odom", rate_hz, node.process.pid)
            with bare_node(graph, report.scratch / "bare", rate_hz) as bare:
                theirs = watch(graph, "bare_odom", rate_hz, bare.process.pid)
        times = ours.cpu / theirs.cpu
        rows.append(f"{rate_hz:g} | {_stream(ours)} | {_stream(theirs)} | {times:.2f}")
        if rate_hz == CPU_AT_HZ:
            report.at_most("CPU at 100 Hz / the peer's", times, CPU_TIMES)
    report.say(STREAMS)
    of_each = "Hz | arrivals [ms] | stamps [ms] | CPU"
    report.table(f"asked | node: {of_each} | peer: {of_each} | CPU / peer's", rows)


def _stream(found: Stream) -> str:
    return (
        f"{found.rate_hz:.1f} | {found.arrival_jitter_s * 1e3:.2f} | "
        f"{found.stamp_jitter_s * 1e3:.2f} | {found.cpu:.1%}"
    )


def main(report: Report) -> None:
    """Measure and print."""
    show_latency(report)
    show_motors(report)
    show_attached(report)
    show_streams(report)


run(main)
