"""Commands that talk to a robot: info, drive, monitor, estop, clear."""

from __future__ import annotations

import math
import time
from typing import Annotated

import typer

from wheelwire.drivers.serial import DEFAULT_BAUD_RATE, SerialDriver
from wheelwire.odometry import Odometry
from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import SupervisorState

from .output import JsonFlag, console, plain, print_facts, print_json

PortArgument = Annotated[
    str, typer.Argument(help="Device path or URL, such as /dev/ttyUSB0 or socket://host:port.")
]
BaudOption = Annotated[int, typer.Option(help="Tried first; then the usual rates.")]

COMMAND_PERIOD_S = 0.05
TTL_S = 0.3
PRINT_PERIOD_S = 0.2

_CORE_DUMP = "of a crash, in flash; docs/hardware-test.md says how to read it"
_LATCHED = (SupervisorState.ESTOPPED, SupervisorState.FAULT)


def info(
    port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE, as_json: JsonFlag = False
) -> None:
    """Tell who is at the port, and how well the link works."""
    with SerialDriver(port, baud_rate=baud) as robot:
        sample = robot.read()
        link, statistics = robot.info, robot.statistics
        device_counters = robot.device_counters()
    if as_json:
        print_json(
            {
                "link": link,
                "core_dump": link.device.has_core_dump,
                "state": sample.state,
                "faults": sample.faults,
                "host_counters": statistics,
                "device_counters": device_counters,
            }
        )
        return
    device = link.device
    latency = {True: "yes", False: "no: the kernel may hold bytes back", None: "not applicable"}
    print_facts(
        f"Robot at {link.port}",
        [
            ("board", f"{device.board.name}, {device.board_id}"),
            ("firmware", f"{device.release} {device.git_hash}".rstrip()),
            ("last start", device.reset_reason.doc),
            ("core dump", _CORE_DUMP if device.has_core_dump else "none"),
            ("state", f"{sample.state.name}: {sample.state.doc}"),
            ("faults", ", ".join(plain(sample.faults)) or "none"),
            ("battery", "not measured" if sample.battery_v is None else f"{sample.battery_v} V"),
            ("baud rate", link.baud_rate or "not applicable"),
            ("low latency", latency[link.low_latency]),
            (
                "round trip",
                f"p50 {statistics.round_trip_p50_us / 1000:.2f} ms, "
                f"p99 {statistics.round_trip_p99_us / 1000:.2f} ms",
            ),
            ("clock error", f"at most {statistics.clock_error_us / 1000:.2f} ms"),
        ],
    )


def drive(
    port: PortArgument,
    linear: Annotated[float, typer.Option(help="m/s, forward positive.")] = 0.0,
    angular: Annotated[float, typer.Option(help="rad/s, counter-clockwise positive.")] = 0.0,
    seconds: Annotated[float, typer.Option(min=0.0, help="For how long.")] = 1.0,
    baud: BaudOption = DEFAULT_BAUD_RATE,
    as_json: JsonFlag = False,
) -> None:
    """Drive at one velocity for some time, stop, and tell what was driven."""
    with SerialDriver(port, baud_rate=baud) as robot:
        odometry = Odometry(robot.geometry)
        odometry.update(robot.read())
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            robot.set_velocity(linear, angular, ttl=min(TTL_S, left))
            odometry.update(robot.read())
            time.sleep(min(COMMAND_PERIOD_S, max(0.0, end - time.monotonic())))
        robot.stop()
        odometry.update(_standstill(robot))
    pose = odometry.pose
    if as_json:
        print_json(pose)
    else:
        console.print(
            f"drove to x {pose.x_m:+.3f} m, y {pose.y_m:+.3f} m, "
            f"heading {math.degrees(pose.heading_rad):+.1f} deg; stopped"
        )


def _standstill(robot: SerialDriver, patience_s: float = 3.0) -> WheelSample:
    """The first sample of standing wheels, or the newest after `patience_s`."""
    end = time.monotonic() + patience_s
    sample = robot.read()
    while (sample.left_mps or sample.right_mps) and time.monotonic() < end:
        sample = robot.read()
    return sample


def monitor(
    port: PortArgument,
    seconds: Annotated[float, typer.Option(help="For how long; 0: until Ctrl-C.")] = 0.0,
    baud: BaudOption = DEFAULT_BAUD_RATE,
    as_json: JsonFlag = False,
) -> None:
    """Show what the wheels do. Sends no setpoint."""
    with SerialDriver(port, baud_rate=baud) as robot:
        end = time.monotonic() + (seconds or math.inf)
        while time.monotonic() < end:
            sample = robot.read()
            if as_json:
                print_json(sample)
            else:
                console.print(_line(sample, robot.statistics.frames_lost), soft_wrap=True)
                time.sleep(PRINT_PERIOD_S)


def estop(
    port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE, as_json: JsonFlag = False
) -> None:
    """Stop the wheels, and let nobody drive until `clear`."""
    with SerialDriver(port, baud_rate=baud) as robot:
        robot.estop()
    if as_json:
        print_json({"latched": SupervisorState.ESTOPPED})
    else:
        console.print(f"stopped and latched; `wheelwire clear {port}` ends it")


def clear(
    port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE, as_json: JsonFlag = False
) -> None:
    """End an e-stop or a fault; refused while its cause lasts."""
    with SerialDriver(port, baud_rate=baud) as robot:
        state = robot.read().state
        if state is SupervisorState.ESTOPPED:
            robot.clear_estop()
        elif state is SupervisorState.FAULT:
            robot.clear_fault()
    ended = state if state in _LATCHED else None
    if as_json:
        print_json({"ended": ended})
    else:
        console.print("nothing was latched" if ended is None else f"{ended.name} ended")


def _line(sample: WheelSample, lost: int) -> str:
    return (
        f"{sample.t_us / 1e6:10.3f} s  {sample.state.name:9}  "
        f"left {sample.left_ticks:+9d} {sample.left_mps:+.3f} m/s {sample.left_duty:+.2f}  "
        f"right {sample.right_ticks:+9d} {sample.right_mps:+.3f} m/s {sample.right_duty:+.2f}  "
        f"lost {lost}"
    )
