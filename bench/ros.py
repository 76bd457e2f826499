"""The ROS node compared with a bare rclpy node: `make bench`, or this file alone."""

from __future__ import annotations

import sys
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, output_folder, table, table_of_targets
from wheelwire.link.info import quantile

if TYPE_CHECKING:
    from support.ros_load import Stream

ROUNDS = 5
COMMANDS = 80
"""Commands per round; the first ones warm up and are left out."""
RATES_HZ = (50.0, 100.0, 200.0)

TITLE = "## The ROS node\n\n"
METHOD = f"""\
Client, node and peer are processes on loopback (Fast DDS, UDP and shared memory as they come), the
robot is the firmware's core on a pseudo-terminal, which sends 200 states a second. The peer is a
bare rclpy node: its subscriber of `Twist` does nothing, its timer publishes an empty `Odometry` 50
times a second. Latency is from the publication of `cmd_vel` to the arrival of its setpoint at the
other end of the node's port; the peer's ends in its callback. {ROUNDS - 1} interleaved rounds of
{COMMANDS} commands, 100 a second.
"""
MOTORS = """
From the publication of `cmd_vel`, or the call of the service `~/estop`, in another process until a
motor is driven, or none is, by the simulated robot's own account; beside 200 states a second and
with a control step of 1 ms. *Beside other calls*: another client sets a parameter, lists and
describes parameters and saves, each again once it is answered. The peer is a bare rclpy node, which
nobody else calls: from the call of its only service to the callback, which does nothing.
"""
MOTORS_COUNT = 300
MOTORS_ROWS = ("command", "e-stop", "the peer's service")
MOTORS_HZ = 200.0
STOP_LIMIT_MS = 5.0
COMMAND_LIMIT_MS = 2.5
CPU_LIMIT_PERCENT = 6.0
CPU_AT_HZ = 100.0
BESIDE = """
E-stops by programs that are attached to the node while it drives, commanded 100 times a second, on
their way to the other end of the node's port: from the write to the socket of the node's tap, and
from the start of the command `wheelwire estop`, which is a process of its own. *Listeners* are
other programs that are attached, and take all that crosses the link.
"""
BESIDE_COUNTS = (300, 30)
BESIDE_LISTENERS = (0, 2)
BESIDE_LIMIT_MS = 20.0
STREAMS = """\
Jitter is the 99th percentile of what the interval between two messages differs from the period
asked for: of the arrivals at a subscriber in another process, and of the stamps. The node publishes
`odom`, `tf`, `joint_states` and `battery_state`, the peer `odom` alone; CPU is of one core.
"""


def show_latency(folder: Path) -> list[Target]:
    """Print the latency of commands."""
    # Here, as in the functions below: without rclpy this file still has to say that it is missing.
    from support.ros import open_graph
    from support.ros_load import Commander, RobotCommander, bare_node, interrupt
    from support.ros_process import RobotNode
    from support.stand_in import StandIn
    from wheelwire.simulation.simulator import Simulator

    with (
        open_graph() as graph,
        Simulator() as simulator,
        closing(StandIn("support.wire_tap", simulator.port)) as tap,
        RobotNode(graph, port=tap.first_answer["port"], publish_rate=MOTORS_HZ),
        bare_node(graph, folder / "bare", 50.0) as bare,
    ):
        graph.wait_active()
        commanders: dict[str, Commander | RobotCommander] = {
            "cmd_vel to the setpoint on the wire": RobotCommander(graph, tap),
            "the peer: to its callback": Commander(graph, "bare_cmd_vel", folder / "bare"),
        }
        # In turns, so that a slow moment of the computer affects both.
        for _ in range(ROUNDS):
            for commander in commanders.values():
                commander.send(COMMANDS)
        # The peer writes down what it heard when it ends.
        interrupt(bare)
        found = {name: c.latencies_s(skipped=COMMANDS) for name, c in commanders.items()}
    reference = list(found.values())[-1]
    rows = [
        [
            name,
            str(len(latencies)),
            *(f"{quantile(latencies, q) * 1e3:.2f}" for q in (0.5, 0.99)),
            *(f"{quantile(latencies, q) / quantile(reference, q):.2f}" for q in (0.5, 0.99)),
        ]
        for name, latencies in found.items()
    ]
    header = ("latency [ms]", "commands", "p50", "p99", "p50 / peer's", "p99 / peer's")
    sys.stdout.write(f"{METHOD}\n{table(header, rows)}\n")
    ours_ms = quantile(next(iter(found.values())), 0.99) * 1e3
    return [_at_most("p99 of a command", ours_ms, COMMAND_LIMIT_MS, "ms")]


def show_motors(folder: Path) -> list[Target]:
    """Print the latency of commands and e-stops."""
    from support.ros import open_graph
    from support.ros_load import latencies_to_the_motors
    from support.ros_process import RobotNode
    from wheelwire.simulation.simulator import Simulator

    rows, targets = [], []
    with (
        open_graph() as graph,
        Simulator(truth_hz=10.0) as simulator,
        RobotNode(graph, port=simulator.port, publish_rate=MOTORS_HZ),
    ):
        for flooded in (False, True):
            beside = " beside other calls" if flooded else ""
            found = latencies_to_the_motors(
                graph, simulator, MOTORS_COUNT, folder / "called", flooded=flooded
            )
            for name, latencies_s in zip(MOTORS_ROWS, found, strict=True):
                p50_ms, p99_ms = (quantile(latencies_s, q) * 1e3 for q in (0.5, 0.99))
                rows.append([name + beside, f"{p50_ms:.2f}", f"{p99_ms:.2f}"])
            p99_ms = quantile(found.estops_s, 0.99) * 1e3
            targets.append(_at_most(f"p99 of an e-stop{beside}", p99_ms, STOP_LIMIT_MS, "ms"))
    header = ("latency [ms]", "p50", "p99")
    sys.stdout.write(f"{MOTORS}\n{table(header, rows)}\n")
    return targets


def show_attached() -> list[Target]:
    """Print the latency of e-stops beside the node."""
    from support.ros import open_graph
    from support.ros_load import attached_estops
    from support.ros_process import RobotNode
    from support.stand_in import StandIn
    from wheelwire.simulation.simulator import Simulator

    rows, targets = [], []
    with (
        open_graph() as graph,
        Simulator(truth_hz=10.0) as simulator,
        closing(StandIn("support.wire_tap", simulator.port)) as tap,
        RobotNode(graph, port=tap.first_answer["port"], publish_rate=MOTORS_HZ),
    ):
        graph.wait_active()
        for listeners in BESIDE_LISTENERS:
            found = attached_estops(graph, simulator, tap, BESIDE_COUNTS, listeners)
            beside = f", {listeners} listeners" if listeners else ""
            for begin, latencies_s in zip(("the write", "the command's start"), found, strict=True):
                p50_ms, p99_ms = (quantile(latencies_s, q) * 1e3 for q in (0.5, 0.99))
                row = [f"from {begin}{beside}", str(len(latencies_s))]
                rows.append([*row, f"{p50_ms:.2f}", f"{p99_ms:.2f}"])
            p99_ms = quantile(found.written_s, 0.99) * 1e3
            what = f"p99 of an e-stop beside the node{beside}"
            targets.append(_at_most(what, p99_ms, BESIDE_LIMIT_MS, "ms"))
    header = ("latency [ms]", "e-stops", "p50", "p99")
    sys.stdout.write(f"{BESIDE}\n{table(header, rows)}\n")
    return targets


def show_streams(folder: Path) -> list[Target]:
    """Print rates, jitter and CPU."""
    rows, targets = [], []
    for rate_hz in RATES_HZ:
        node, bare = streams(folder, rate_hz)
        rows += [
            [f"{rate_hz:g} Hz asked: the node", *_cells(node), f"{node.cpu / bare.cpu:.2f}"],
            [f"{rate_hz:g} Hz asked: the peer", *_cells(bare), "1"],
        ]
        if rate_hz == CPU_AT_HZ:
            cpu = "CPU at 100 Hz"
            targets.append(_at_most(cpu, node.cpu * 100, CPU_LIMIT_PERCENT, "%"))
    header = ("", "Hz", "jitter of arrivals [ms]", "of stamps [ms]", "CPU", "CPU / peer's")
    sys.stdout.write(f"{STREAMS}\n{table(header, rows)}\n")
    return targets


def streams(folder: Path, rate_hz: float) -> tuple[Stream, Stream]:
    """The node's, then the peer's."""
    from support.ros import open_graph
    from support.ros_load import bare_node, watch
    from support.ros_process import RobotNode
    from wheelwire.simulation.simulator import Simulator

    with open_graph() as graph:
        # One after the other: at once, each would take processor time from the other.
        with (
            Simulator() as simulator,
            RobotNode(graph, port=simulator.port, publish_rate=rate_hz) as process,
        ):
            node = watch(graph, "odom", rate_hz, process.process.pid)
        with bare_node(graph, folder / "bare", rate_hz) as process:
            bare = watch(graph, "bare_odom", rate_hz, process.process.pid)
    return node, bare


def _cells(stream: Stream) -> list[str]:
    jitter = (stream.arrival_jitter_s, stream.stamp_jitter_s)
    return [f"{stream.rate_hz:.1f}", *(f"{s * 1e3:.2f}" for s in jitter), f"{stream.cpu:.1%}"]


def _at_most(what: str, measured: float, limit: float, unit: str) -> Target:
    return Target(what, f"{measured:.2f} {unit}", f"<= {limit:g} {unit}", measured <= limit)


def main() -> int:
    """Print the results, or why there are none; 1 if a target is missed."""
    output_folder(__doc__)
    if find_spec("rclpy") is None:
        sys.stdout.write(f"{TITLE}Not measured: rclpy is not installed (`make ros`).\n")
        return 0
    import rclpy  # noqa: F401 - it starts Python once more: before anything is printed

    sys.stdout.write(TITLE)
    with TemporaryDirectory() as folder:
        targets = show_latency(Path(folder))
        targets += show_motors(Path(folder))
        targets += show_attached()
        targets += show_streams(Path(folder))
    sys.stdout.write(table_of_targets(targets))
    return 0 if all(target.reached for target in targets) else 1


if __name__ == "__main__":
    sys.exit(main())
