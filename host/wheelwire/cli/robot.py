"""Commands that talk to a robot: info, drive, monitor, stop, estop, clear, restart."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Annotated

import typer

from wheelwire import errors
from wheelwire.connect import is_recording
from wheelwire.link.holds import HeldBy
from wheelwire.link.info import ActiveBoard, DeviceInfo
from wheelwire.motion.kinematics import Twist
from wheelwire.motion.odometry import Odometry, Pose
from wheelwire.robot.robot import Robot
from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import Contradiction, EventCode, RefusalCode, SupervisorState

from .address import Address, Given, YesFlag, driving
from .interruptions import watch
from .output import (
    console,
    print_facts,
    print_json,
    print_lines,
    print_note,
    print_result,
    printed_json,
    to_json_value,
    wants_json,
)
from .registry import Heading, command
from .sensors import ask_for_samples
from .view import can_show, show

COMMAND_PERIOD_S = 0.05
TTL_S = 0.3
PRINT_PERIOD_S = 1.0
CLEAR_TIMEOUT_S = 1.0
"""How long a state frame may take to show the result of a request; they come at 10 Hz or faster."""
STANDSTILL_S = 3.0

_CORE_DUMP = "of a crash, in flash; docs/hardware-test.md says how to read it"


@command("info", Heading.LOOK, 1, page="command-line")
def info(given: Given) -> None:
    """Show the connected board, its state and link quality."""
    from wheelwire.log.why.device import ledger_counts, ledger_facts
    from wheelwire.tools.doctor.robot import memory_facts, memory_of

    address = given.resolve()
    with address.open_to_look() as driver:
        if not driver.has_device:
            raise errors.DriverUnavailable(
                f"the driver of {address.text} has no information about its device; "
                f"`wheelwire monitor {address.text}` shows the wheels"
            )
        sample = driver.read()
        device_counters = driver.device_counters()
        ledger, memory = driver.recorder.read(boxes=False).ledger, memory_of(driver)
        warnings = _warnings(driver, sample, address.text)
        holding = driver.holding()
        link, statistics = driver.info, driver.statistics
    if printed_json(
        {
            "link": link,
            "core_dump": link.device.has_core_dump,
            "state": sample.state,
            "faults": sample.faults,
            "held_by": holding.held_by.names,
            "last_stop": holding.last_stop,
            "host_counters": statistics,
            "device_counters": device_counters,
            "ledger": None if ledger is None else ledger_counts(ledger),
            "memory": memory,
            "warnings": warnings,
        }
    ):
        return
    device = link.device
    latency = {True: "yes", False: "no: the kernel may delay bytes", None: "not applicable"}
    print_facts(
        f"Robot at {link.port}",
        [
            ("chip", f"{device.board.name}, {device.board_id}"),
            ("board", _board(link.board)),
            ("firmware", _firmware(device)),
            ("last start", device.reset_reason.doc),
            ("core dump", _CORE_DUMP if device.has_core_dump else "none"),
            ("state", _state(sample.state, address.text)),
            ("faults", ", ".join(to_json_value(sample.faults)) or "none"),
            ("held by", _held(holding.held_by)),
            ("last stop", str(holding.last_stop)),
            ("battery", "not measured" if sample.battery_v is None else f"{sample.battery_v} V"),
            ("baud rate", link.baud_rate or "not applicable"),
            ("low latency", latency[link.low_latency]),
            (
                "round trip",
                f"p50 {statistics.round_trip_p50_us / 1000:.2f} ms, "
                f"p99 {statistics.round_trip_p99_us / 1000:.2f} ms",
            ),
            ("clock error", f"at most {statistics.clock_error_us / 1000:.2f} ms"),
            *([("memory", "unknown")] if memory is None else memory_facts(memory).items()),
            *([] if ledger is None else ledger_facts(ledger).items()),
        ],
    )
    print_lines(*(f"warning: {warning}" for warning in warnings))


def _held(held_by: HeldBy) -> str:
    return f"{', '.join(held_by.names)}. {held_by}" if held_by else "nothing"


def _firmware(device: DeviceInfo) -> str:
    return f"{device.release} {device.git_hash}".rstrip()


def _board(board: ActiveBoard | None) -> str:
    if board is None:
        return "not stored on the device"
    if not board.name:
        return f"{board.state.name}: {board.state.doc}"
    peripherals = (
        "1 peripheral" if board.peripheral_count == 1 else (f"{board.peripheral_count} peripherals")
    )
    return f"{board.name}, {peripherals}, {board.fingerprint:08x}: {board.state.doc}"


def _warnings(driver: Robot, sample: WheelSample, address: str) -> list[str]:
    """What keeps the robot from driving, or makes it less safe; of a fault how to end it."""
    from wheelwire.log.why.causes import cure_of_stores

    active = driver.contradictions()
    found = [flag.doc for flag in Contradiction if flag in active]
    found += driver.warnings
    found += [code.doc for code in driver.info.copies_lost]
    if cure := cure_of_stores(sample.faults, address):
        found.append(f"What is stored cannot be used: run {cure}.")
    if driver.rolling_mps is not None:
        found.append(f"{EventCode.ROLLING.doc} It did at {driver.rolling_mps:.2f} m/s.")
    return found


def _state(state: SupervisorState, address: str) -> str:
    """The state; of a latched one also the command that ends it."""
    text = f"{state.name}: {state.doc}"
    return f"{text} `wheelwire clear {address}` ends it" if state.is_latched else text


def _latched(sample: WheelSample, address: str) -> str:
    """Why nothing drives, and the command that ends it."""
    state, faults = _state(sample.state, address), errors.fault_names(sample.faults)
    return f"{state.rstrip('.')}. {faults}" if faults else state


@command("drive", Heading.DRIVE, 1, page="tutorial/6-drive")
def drive(
    given: Given,
    linear: float | None = None,
    angular: float | None = None,
    seconds: Annotated[float, typer.Option(min=0.0)] = 1.0,
    yes: YesFlag = False,
) -> None:
    """Drive at a constant velocity for a set time, stop, and report the distance.

    Args:
        given: The robot.
        linear: m/s, forward positive.
        angular: rad/s, counter-clockwise positive.
        seconds: For how long.
        yes: Do not ask.
    """
    if linear is None and angular is None:
        raise errors.InvalidCommand("no velocity given: use --linear, --angular or both")
    asked = Twist(linear or 0.0, angular or 0.0)
    address = given.resolve(moves=True, yes=yes)
    with driving(address) as driver:
        # Needed when the driver is closed, which has no geometry any more.
        geometry = driver.geometry
        ask_for_samples(driver)
        try:
            end, pose, late = _drive(driver, asked, seconds)
        except errors.DeviceRefused as error:
            hint = f"`wheelwire clear {address.text}` ends it"
            if error.code == RefusalCode.ESTOPPED:
                hint += f". {_without_contact(address.text)}"
            elif error.code == RefusalCode.FAULT:
                hint += " once you have removed its cause"
            else:
                raise
            raise error.hinted("the setpoint", hint) from error
        triggered = _triggered(driver)
    if triggered:
        print_note(f"{', '.join(triggered)} triggered: this robot does not drive against that")
    # What the driver made of it: both wheels scaled to the faster one's limit.
    driven = geometry.twist(geometry.saturate(geometry.wheel_velocities(asked)))
    rolled_m = math.hypot(pose.x_m - end.x_m, pose.y_m - end.y_m)
    if wants_json():
        result = {**pose._asdict(), **driven._asdict(), "rolled_out_m": rolled_m}
        print_json({**result, "late_setpoints": late})
        return
    if late:
        print_lines(
            f"{late} setpoints had expired when they arrived, and the wheels stopped meanwhile: "
            "this computer is too busy"
        )
    if not math.isclose(driven.linear_mps, asked.linear_mps) or not math.isclose(
        driven.angular_radps, asked.angular_radps
    ):
        print_lines(
            f"limited to {driven.linear_mps:.3g} m/s and {driven.angular_radps:.3g} rad/s: no "
            f"wheel may exceed {geometry.max_velocity_mps:g} m/s, the robot's max_velocity_mps"
        )
    print_lines(
        f"drove to x {pose.x_m:+.3f} m, y {pose.y_m:+.3f} m, "
        f"heading {math.degrees(pose.heading_rad):+.1f} deg, the last {rolled_m:.3f} m of it "
        f"while stopping"
    )


def _triggered(robot: Robot) -> tuple[str, ...]:
    """The inputs that act on the robot now, by name; none if nothing tells."""
    with suppress(errors.WheelwireError):  # it has no inputs, or cannot be asked any more
        return robot.inputs.read().triggered
    return ()


def _drive(robot: Robot, twist: Twist, seconds: float) -> tuple[Pose, Pose, int]:
    """Drive and stop.

    Returns:
        The poses when the stop was acknowledged and at standstill, and the number of setpoints
        that had expired when they arrived.
    """
    odometry = Odometry(robot.geometry)
    odometry.update(robot.read())
    longest_s = min(TTL_S, robot.ttl_max_s or TTL_S)
    if seconds > 0:
        # The person who starts this command means this motion, also just after a clear.
        robot.set_velocity(0.0, 0.0, ttl=longest_s)
    end = time.monotonic() + seconds
    valid_until = -math.inf
    late_before = robot.statistics.setpoints_expired
    # The stop below ends the drive. The last setpoint outlives it a little: a drive that its
    # setpoint's expiry ends looks like one whose program was killed.
    last = end + COMMAND_PERIOD_S
    while (now := time.monotonic()) < end:
        if valid_until < last:
            ttl = min(longest_s, last - now)
            robot.set_velocity(*twist, ttl=ttl)
            valid_until = last if now + longest_s >= last else now + ttl
        # Ticks are cumulative, so no travel is lost with the samples that are skipped.
        odometry.update(robot.read())
        time.sleep(min(COMMAND_PERIOD_S, max(0.0, end - time.monotonic())))
    robot.stop()
    stopped = odometry.update(robot.read()).pose
    odometry.update(_standstill(robot))
    return stopped, odometry.pose, robot.statistics.setpoints_expired - late_before


def _without_contact(address: str) -> str:
    return (
        "If no e-stop contact is fitted, connect its pin to ground, clear, and run "
        f"`wheelwire params set {address} estop_input_enabled 0 --save`."
    )


def _standstill(robot: Robot) -> WheelSample:
    """The first sample of wheels at rest, or the newest after a while."""
    end = time.monotonic() + STANDSTILL_S
    sample = robot.read()
    while (sample.left_mps or sample.right_mps) and time.monotonic() < end:
        sample = robot.read()
    return sample


@command("monitor", Heading.LOOK, 2, page="view")
def monitor(
    given: Given, seconds: Annotated[float, typer.Option(min=0.0)] = 0.0, plain: bool = False
) -> None:
    """Show wheel speeds, duties, state, and why it stopped. Goes on when a lost link is back.

    On a terminal it takes the whole screen, with plots, and keys that stop, clear, tune, drive and
    record (press ?). Elsewhere it prints lines, and sends nothing. It also plays a recording.

    Args:
        given: The robot.
        seconds: For how long; 0: until Ctrl-C.
        plain: Print lines; never take the whole screen.
    """
    address = given.resolve()
    if not (plain or wants_json()) and can_show():
        show(address, seconds)
        return
    with address.open_to_look() as driver, _ended_by_the_recording(address.text):
        if driver.has_device:
            with suppress(errors.InvalidCommand):  # a recording: `why` names its stops
                driver.watch_stops(
                    lambda stop: print_note(f"{stop.sentence} Look first at {stop.look_at}.")
                )
            driver.on_held = lambda held_by: print_note(
                f"held by {', '.join(held_by.names)}: {held_by}" if held_by else "nothing holds it"
            )
        end = time.monotonic() + (seconds or math.inf)
        shown: SupervisorState | None = None
        for news in watch(driver, end):
            if isinstance(news, str):
                print_note(news)
                continue
            if wants_json():
                print_json(news)
                continue
            print_lines(_line(news, driver.statistics.frames_lost))
            if news.state.is_latched and news.state is not shown:
                print_lines(_latched(news, address.text))
            shown = news.state
            # A person, or a log, has no use for more.
            time.sleep(max(0.0, min(PRINT_PERIOD_S, end - time.monotonic())))


@contextmanager
def _ended_by_the_recording(address: str) -> Iterator[None]:
    """The end of a recording is not the loss of a robot."""
    try:
        yield
    except errors.LinkClosed:
        if not is_recording(address):
            raise


@command("estop", Heading.DRIVE, 4, page="stops")
def estop(given: Given) -> None:
    """Emergency stop: stop the wheels and refuse to drive until `clear`."""
    # Here: only this command needs all of them, and each of its imports takes time.
    from wheelwire.drivers.attached import AttachedDriver
    from wheelwire.drivers.l298n import L298NDriver
    from wheelwire.drivers.pigpio import PigpioDriver
    from wheelwire.drivers.serial import SerialDriver

    address = given.resolve()
    driver = _stopped(address, lambda robot: robot.estop())
    # A process that this command started ends with it, but its latch stays. A simulated robot is
    # gone.
    lasting = isinstance(driver, (AttachedDriver, SerialDriver, L298NDriver, PigpioDriver))
    after = f"once {driver.holder.name}, has ended, " if isinstance(driver, AttachedDriver) else ""
    text = "stopped, but not latched: this robot is simulated by this command, and ended with it"
    if lasting:
        text = f"stopped and latched; {after}`wheelwire clear {address.text}` ends it"
    latched = SupervisorState.ESTOPPED if lasting else None
    print_result({"latched": latched}, text)


@command("stop", Heading.DRIVE, 3, page="stops")
def stop(given: Given) -> None:
    """Stop the wheels. The next setpoint drives again; `estop` keeps the robot stopped."""
    from wheelwire.drivers.attached import AttachedDriver

    address = given.resolve()
    driver = _stopped(address, lambda robot: robot.stop())
    text = "stopped"
    if isinstance(driver, AttachedDriver):
        text = (
            f"stopped; the next setpoint of {driver.holder.name}, drives again: "
            f"`wheelwire estop {address.text}` keeps it from driving"
        )
    print_result({"stopped": True}, text)


def _stopped(address: Address, act: Callable[[Robot], None]) -> Robot:
    """Stop the robot by `act`; returns the driver that did it, closed."""
    if is_recording(address.text):
        raise errors.InvalidArgument(
            f"{address.text} is a recording, and cannot stop: name a robot"
        )
    try:
        return _stopped_by_anyone(address, act)
    except errors.LinkClosed:  # the program that held the port just ended
        return _stopped_by_anyone(address, act)


def _stopped_by_anyone(address: Address, act: Callable[[Robot], None]) -> Robot:
    try:
        opened = address.open_to_look(listens=False)
    except errors.PortUnavailable as error:
        raise errors.PortUnavailable(error.port, f"{error.reason}. Nothing was sent") from error
    except errors.DriverUnavailable as error:
        raise errors.DriverUnavailable(f"{error}. Nothing was sent") from error
    with opened as driver:
        act(driver)
    return driver


@command("clear", Heading.DRIVE, 5, page="stops")
def clear(given: Given, yes: YesFlag = False) -> None:
    """Clear an e-stop or a fault; refused while its cause lasts."""
    address = given.resolve(moves=True, yes=yes)
    with address.open(bare=True) as driver:
        before = after = driver.read()
        if before.state is SupervisorState.ESTOPPED:
            try:
                driver.clear_estop()
            except errors.DeviceRefused as error:
                hint = _without_contact(address.text)
                raise error.hinted("to end the e-stop", hint) from error
        elif before.state is SupervisorState.FAULT:
            driver.clear_fault()
        # The next sample may have been measured before the answer.
        end = time.monotonic() + CLEAR_TIMEOUT_S
        while before.state.is_latched and after.state is before.state and time.monotonic() < end:
            after = driver.read()
    ended = before.state if before.state.is_latched else None
    if printed_json({"ended": ended, "state": after.state, "faults": after.faults}):
        return
    if ended is None:
        console.print("nothing was latched")
        return
    console.print(f"{ended.name} cleared")
    # A fault that the e-stop hid is active again.
    if after.state.is_latched:
        print_lines(
            f"{after.state.name} remains. {errors.fault_names(after.faults)} "
            f"Fix the cause, then run `wheelwire clear {address.text}` again"
        )


@command("restart", Heading.DRIVE, 6, page="command-line")
def restart(given: Given) -> None:
    """Restart the device, wait for it, and say what is active.

    Values that were not saved are lost; a latched e-stop or fault stays latched. Refused while the
    robot drives.
    """
    address = given.resolve()
    # Bare: a robot's file would set its values again, and they are not what the device has saved.
    with address.open(bare=True) as driver:
        if not driver.has_device:
            raise errors.DriverUnavailable(
                f"the driver of {address.text} has no device to restart: name another robot"
            )
        before = driver.info.device.boot_id
        try:
            driver.board.restart()
        except errors.DeviceRefused as error:
            service = "Restart the program or the service that moves its pins."
            hints: dict[int, str] = {
                RefusalCode.NOT_SUPPORTED: service,
                RefusalCode.NOT_STOPPED: f"`wheelwire stop {address.text}` stops it.",
            }
            raise error.hinted("to restart", hints.get(error.code, "")) from error
        sample = driver.read()
        while sample.boot_id == before:  # it was on its way
            sample = driver.read()
        device, board = driver.info.device, driver.info.board
        warnings = _warnings(driver, sample, address.text)
    if printed_json(
        {
            "device": device,
            "board": board,
            "state": sample.state,
            "faults": sample.faults,
            "warnings": warnings,
        }
    ):
        return
    print_facts(
        f"Robot at {address.text} is back",
        [
            ("firmware", _firmware(device)),
            ("board", _board(board)),
            ("last start", device.reset_reason.doc),
            ("state", _latched(sample, address.text)),
        ],
    )
    print_lines(*(f"warning: {warning}" for warning in warnings))


def _line(sample: WheelSample, lost: int) -> str:
    return (
        f"{sample.t_us / 1e6:10.3f} s  {sample.state.name:9}  "
        f"left {sample.left_ticks:+9d} {sample.left_mps:+.3f} m/s {sample.left_duty:+.2f}  "
        f"right {sample.right_ticks:+9d} {sample.right_mps:+.3f} m/s {sample.right_duty:+.2f}  "
        f"lost {lost}"
    )
