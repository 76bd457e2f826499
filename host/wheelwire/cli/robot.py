"""Commands that talk to a robot: info, drive, monitor, estop, clear."""

from __future__ import annotations

import math
import time
from typing import Annotated

import typer

from wheelwire.drivers.serial import DEFAULT_BAUD_RATE, SerialDriver
from wheelwire.errors import DeviceRefused, InvalidCommand
from wheelwire.motion.kinematics import Twist
from wheelwire.motion.odometry import Odometry, Pose
from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import Fault, RefusalCode, SupervisorState

from .output import JsonFlag, console, plain, print_facts, print_json

PortArgument = Annotated[
    str, typer.Argument(help="Device path or URL, such as /dev/ttyUSB0 or socket://host:port.")
]
BaudOption = Annotated[int, typer.Option(help="Tried first; then the usual rates.")]

COMMAND_PERIOD_S = 0.05
TTL_S = 0.3
PRINT_PERIOD_S = 0.2
CLEAR_PATIENCE_S = 1.0
"""Until a state frame shows what came of a request; they come at 10 Hz at least."""

_CORE_DUMP = "of a crash, in flash; docs/hardware-test.md says how to read it"
_LATCHED = (SupervisorState.ESTOPPED, SupervisorState.FAULT)


def info(
    port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE, as_json: JsonFlag = False
) -> None:
    """Show the connected board, its state and link quality."""
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
            ("state", _state(sample.state, port)),
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


def _state(state: SupervisorState, port: str) -> str:
    """The state, and what ends it where something has to be done."""
    text = f"{state.name}: {state.doc}"
    return f"{text} `wheelwire clear {port}` ends it" if state in _LATCHED else text


def drive(
    port: PortArgument,
    linear: Annotated[float | None, typer.Option(help="m/s, forward positive.")] = None,
    angular: Annotated[
        float | None, typer.Option(help="rad/s, counter-clockwise positive.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="For how long.")] = 1.0,
    baud: BaudOption = DEFAULT_BAUD_RATE,
    as_json: JsonFlag = False,
) -> None:
    """Drive at a constant velocity for a set time, stop, and report the distance."""
    if linear is None and angular is None:
        raise InvalidCommand("say how fast: give --linear, --angular or both")
    asked = Twist(linear or 0.0, angular or 0.0)
    with SerialDriver(port, baud_rate=baud) as robot:
        geometry = robot.geometry
        try:
            end, pose = _drive(robot, asked, seconds)
        except DeviceRefused as error:
            if error.code != RefusalCode.ESTOPPED:
                raise
            hint = f"`wheelwire clear {port}` ends it. {_without_contact(port)}"
            raise DeviceRefused(error.code, "the setpoint", hint=hint) from error
    driven = geometry.twist(geometry.saturate(geometry.wheel_velocities(asked)))
    rolled_m = math.hypot(pose.x_m - end.x_m, pose.y_m - end.y_m)
    if as_json:
        print_json({**pose._asdict(), **driven._asdict(), "rolled_out_m": rolled_m})
        return
    if not math.isclose(driven.linear_mps, asked.linear_mps) or not math.isclose(
        driven.angular_radps, asked.angular_radps
    ):
        console.print(
            f"drove at {driven.linear_mps:.3g} m/s and {driven.angular_radps:.3g} rad/s: no wheel "
            f"turns faster than {geometry.max_velocity_mps:g} m/s, the robot's max_velocity_mps",
            soft_wrap=True,
        )
    console.print(
        f"drove to x {pose.x_m:+.3f} m, y {pose.y_m:+.3f} m, "
        f"heading {math.degrees(pose.heading_rad):+.1f} deg, the last {rolled_m:.3f} m of it "
        f"coming to a stop; stopped",
        soft_wrap=True,
    )


def _drive(robot: SerialDriver, twist: Twist, seconds: float) -> tuple[Pose, Pose]:
    """Drive and stop; returns where the command ended, and where the robot stands."""
    odometry = Odometry(robot.geometry)
    odometry.update(robot.read())
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        robot.set_velocity(*twist, ttl=min(TTL_S, left))
        odometry.update(robot.read())
        time.sleep(min(COMMAND_PERIOD_S, max(0.0, end - time.monotonic())))
    robot.stop()
    stopped = odometry.update(robot.read()).pose
    odometry.update(_standstill(robot))
    return stopped, odometry.pose


def _without_contact(port: str) -> str:
    return (
        "Where no e-stop contact is fitted, join its pin to ground, clear, and run "
        f"`wheelwire params set {port} estop_input_enabled 0 --save`."
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
    seconds: Annotated[float, typer.Option(min=0.0, help="For how long; 0: until Ctrl-C.")] = 0.0,
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
    """Emergency stop: stop the wheels and refuse to drive until `clear`."""
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
        before = after = robot.read()
        if before.state is SupervisorState.ESTOPPED:
            _clear_estop(robot, port)
        elif before.state is SupervisorState.FAULT:
            robot.clear_fault()
        end = time.monotonic() + CLEAR_PATIENCE_S
        while before.state in _LATCHED and after.state is before.state and time.monotonic() < end:
            after = robot.read()
    ended = before.state if before.state in _LATCHED else None
    if as_json:
        print_json({"ended": ended, "state": after.state, "faults": after.faults})
        return
    if ended is None:
        console.print("nothing was latched")
        return
    console.print(f"{ended.name} ended")
    if after.state in _LATCHED:
        faults = " ".join(f"{fault.name}: {fault.doc}" for fault in Fault if fault in after.faults)
        console.print(
            f"{after.state.name} remains. {faults} Mend it, then `wheelwire clear {port}` again",
            soft_wrap=True,
        )


def _clear_estop(robot: SerialDriver, port: str) -> None:
    try:
        robot.clear_estop()
    except DeviceRefused as error:
        hint = _without_contact(port)
        raise DeviceRefused(error.code, "to end the e-stop", hint=hint) from error


def _line(sample: WheelSample, lost: int) -> str:
    return (
        f"{sample.t_us / 1e6:10.3f} s  {sample.state.name:9}  "
        f"left {sample.left_ticks:+9d} {sample.left_mps:+.3f} m/s {sample.left_duty:+.2f}  "
        f"right {sample.right_ticks:+9d} {sample.right_mps:+.3f} m/s {sample.right_duty:+.2f}  "
        f"lost {lost}"
    )
