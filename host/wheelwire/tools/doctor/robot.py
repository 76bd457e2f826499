"""Checks of a robot that was named: its firmware, its settings, its link, what holds it."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator

from wheelwire_protocol.codes import (
    BatteryLevel,
    Capability,
    Contradiction,
    Fault,
    Held,
    SensorEventCode,
    SensorState,
    SupervisorEvent,
)
from wheelwire_protocol.types import MemoryValue

from ...errors import DeviceRefused, GroupUnavailable, InvalidCommand
from ...link.clock import host_clock_us
from ...link.holds import UNARMED
from ...link.info import library_version
from ...log.why.causes import STORED, cure_of_stores, latched_causes, sentence_of
from ...log.why.device import FAILURES, counts_text, standing_stops
from ...parameters import number_text
from ...robot.robot import Robot
from ...robot.sensors import wait_until_read
from ...samples import InputsSample, PowerSample, sentence_of_event
from .finding import Finding

WATCH_S = 1.5
"""How long the doctor listens to the link before it judges its loss and its clock."""
CLOCK_ERROR_LIMIT_US = 5_000.0
LOSS_LIMIT = 0.01
LEAST_HEAP, LEAST_STACK = 10_000, 512
"""Bytes that a sound robot has left at any time."""
_SENSORS = Held.CLIFF | Held.FAULT_INPUT | Held.BATTERY | Held.BATTERY_UNKNOWN
_SENSORS |= Held.BUMPER_FRONT | Held.BUMPER_FRONT_LEFT | Held.BUMPER_FRONT_RIGHT
_SENSORS |= Held.BUMPER_REAR | Held.BUMPER_REAR_LEFT | Held.BUMPER_REAR_RIGHT
_NAMED_ELSEWHERE = Held.ESTOP | Held.CONTACT | Held.FAULT | Held.CONTRADICTION | UNARMED
"""Holds that other checks report, and being unarmed, as every robot is that is only looked at."""


def examine_robot(driver: Robot, address: str, given: Collection[str] = ()) -> Iterator[Finding]:
    """What is wrong with a robot, and with the link to it.

    Args:
        driver: An open driver, or one attached to the program that holds the robot.
        address: As the user named it, for the cures.
        given: Parameters in the robot's file, which each session sets.

    Raises:
        LinkLost: The robot went out of reach.
        RequestTimeout: It does not answer.
    """
    for check in (
        _firmware,
        _groups,
        _stores,
        _core_dump,
        _contradictions,
        _contact,
        _stops,
        _ledger,
        _memory,
    ):
        yield from check(driver, address)
    yield from _unsaved(driver, address, given)
    time.sleep(WATCH_S)
    yield from _link(driver)
    # Afterwards: their samples take their part of the line.
    sensed = list(_sensors(driver))
    yield from sensed
    yield from _held(driver, address, is_sensed=bool(sensed))


def _firmware(driver: Robot, address: str) -> Iterator[Finding]:
    theirs, ours = driver.info.device.release.release, library_version()
    older = _numbers(theirs), _numbers(ours)
    if all(older) and older[0] < older[1]:
        yield Finding(
            "firmware",
            f"the firmware is {theirs}, older than this library, {ours}.",
            f"wheelwire flash {address} with the image of release {ours}",
        )


def _numbers(version: str) -> tuple[int, ...]:
    """`0.1.0.dev3` -> 0, 1, 0; empty if it is not a version."""
    parts = version.split(".")[:3]
    return tuple(int(part) for part in parts) if all(p.isdigit() for p in parts) else ()


def _groups(driver: Robot, address: str) -> Iterator[Finding]:
    if Capability.RESTART not in driver.info.device.capabilities:
        return  # it has no board that could be asked for
    try:
        driver.board.read()
    except GroupUnavailable as error:
        yield Finding(
            "groups",
            f"{error.group} messages do not work: firmware and library have different ones.",
            f"wheelwire flash {address} with the image of this library's release",
        )


def _stores(driver: Robot, address: str) -> Iterator[Finding]:
    faults = driver.read().faults & STORED
    if faults:
        sentences = " ".join(sentence_of(causes) for _, causes, _ in latched_causes(faults))
        yield Finding("store", f"{sentences} Nothing drives.", cure_of_stores(faults, address))
    for code in driver.info.copies_lost:
        yield Finding(
            "store-copy",
            code.doc,
            "nothing now; if it recurs, the flash wears out: replace the board",
        )


def _core_dump(driver: Robot, _address: str) -> Iterator[Finding]:
    if driver.info.device.has_core_dump:
        yield Finding(
            "core-dump",
            "the firmware crashed, and its core dump is in flash.",
            "read it and report it: docs/hardware-test.md#4-after-a-crash",
        )


def memory_of(driver: Robot) -> MemoryValue | None:
    """How much of the chip's memory is left; None where the robot cannot tell."""
    try:
        return driver.memory()
    # It has no chip; or its firmware, or the program that holds the port, is of an older release.
    except (GroupUnavailable, InvalidCommand):
        return None


def memory_facts(memory: MemoryValue) -> dict[str, str]:
    """The same for people."""
    stacks = _stacks(memory)
    task = min(stacks, key=lambda name: stacks[name], default="")
    least = f"{stacks[task]} bytes, in the {task} task" if task else "not measured yet"
    return {
        "free heap": f"{memory.free_heap} bytes; never less than {memory.least_free_heap}",
        "lowest stack": least,
    }


def _stacks(memory: MemoryValue) -> dict[str, int]:
    """The fewest bytes ever left, by task; without tasks that do not run."""
    left = memory._asdict()
    return {
        name.removesuffix("_stack"): value
        for name, value in left.items()
        if name.endswith("_stack") and value
    }


def _memory(driver: Robot, address: str) -> Iterator[Finding]:
    memory = memory_of(driver)
    if memory is None:
        return
    scarce = [name for name, left in _stacks(memory).items() if left < LEAST_STACK]
    what = [f"stack of the {name} task" for name in scarce]
    if memory.least_free_heap < LEAST_HEAP:
        what.insert(0, "heap")
    if what:
        yield Finding(
            "memory",
            f"the chip was about to run out of {' and '.join(what)}.",
            f"report it with what `wheelwire support {address}` packs",
        )


def _contradictions(driver: Robot, _address: str) -> Iterator[Finding]:
    active = driver.contradictions()
    for flag in Contradiction:
        if flag in active:
            problem, _, cure = flag.doc.partition("; ")
            yield Finding("contradiction", f"{problem}: nothing drives.", cure.rstrip("."))


def _unsaved(driver: Robot, address: str, given: Collection[str]) -> Iterator[Finding]:
    try:
        unsaved = driver.unsaved_parameters()
    # It drives; or its firmware, or the program that holds the port, is of an older release.
    except (DeviceRefused, GroupUnavailable, InvalidCommand):
        return
    # `_contact` reports the e-stop's input; saving that it is off would not be a cure.
    names = [name for name in unsaved if name not in (*given, "estop_input_enabled")]
    if names:
        yield Finding(
            "unsaved",
            f"the next reset changes {', '.join(names)}: set, but not saved.",
            f"wheelwire params save {address} {' '.join(names)}",
        )


def _contact(driver: Robot, address: str) -> Iterator[Finding]:
    board = driver.info.board
    if board is not None and board.has_contact:
        value = driver.parameters["estop_input_enabled"]
        if not value:
            yield Finding(
                "estop-input",
                f"the board {board.name} has an e-stop contact, but estop_input_enabled is "
                f"{number_text(value)}: pressing it does nothing.",
                f"wheelwire params set {address} estop_input_enabled 1 --save",
            )


def _stops(driver: Robot, address: str) -> Iterator[Finding]:
    sample = driver.read()
    device = driver.info.device
    end = f"; wheelwire clear {address} ends it" if sample.state.is_latched else ""
    # `_stores` reports the others.
    faults = sample.faults & ~STORED
    holding = driver.holding()
    for stop in standing_stops(device, sample.state, faults, host_clock_us(), holding=holding):
        yield Finding(
            "stopped",
            stop.sentence,
            f"look first at {stop.look_at}; wheelwire why {address} has the evidence{end}",
        )


def _held(driver: Robot, address: str, *, is_sensed: bool) -> Iterator[Finding]:
    """What holds the robot; `is_sensed`: the sensors' samples have already named the sensors."""
    held_by = driver.holding().held_by
    named = _NAMED_ELSEWHERE | (_SENSORS if is_sensed else Held(0))
    if Fault.NO_BOARD in driver.read().faults:
        named |= Held.CONFIGURATION_UNUSABLE  # by `_stores`
    for flag in held_by:
        if flag not in named:
            problem, _, cure = held_by.sentence(flag).partition(": ")
            yield Finding(
                "held",
                f"{flag.name}: {problem[0].lower()}{problem[1:]}.",
                cure.rstrip(".") or f"wheelwire why {address}",
            )


def _ledger(driver: Robot, address: str) -> Iterator[Finding]:
    ledger = driver.recorder.read(boxes=False).ledger
    if ledger is None:
        return
    counts = {reason.name: ledger.resets[reason] for reason in FAILURES}
    counts["faults"] = ledger.stops[SupervisorEvent.FAULT]
    if any(counts.values()):
        yield Finding(
            "ledger",
            f"in {ledger.uptime_s / 3600:.1f} h of operation the robot had {counts_text(counts)}.",
            f"wheelwire why {address} has what was recorded of them",
        )


def _link(driver: Robot) -> Iterator[Finding]:
    now = driver.statistics
    if now.clock_error_us > CLOCK_ERROR_LIMIT_US:
        yield Finding(
            "clock-error",
            f"the robot's clock is known to {now.clock_error_us / 1000:.1f} ms only: round trips "
            "take long or vary.",
            "use another USB socket or hub, run fewer busy processes, ask for low latency",
        )
    if now.recent_loss > LOSS_LIMIT:
        yield Finding(
            "loss",
            f"{now.recent_loss:.0%} of the robot's frames were lost in the last second.",
            "use a shorter cable away from the motor wires, another socket, or a lower "
            "stream_rate_hz",
        )


def _sensors(driver: Robot) -> Iterator[Finding]:
    sensors = driver.sensors
    try:
        sensors.events()  # asks for samples
    except (GroupUnavailable, InvalidCommand):
        return  # or the program that holds the port refuses to ask for them
    wait_until_read(sensors)
    for status in sensors.channels:
        name, sample = status.info.name, status.sample
        if status.state is not SensorState.OK:
            yield Finding(
                "sensor",
                f"{name} cannot be used: {status.sentence}.",
                f"docs/sensors.md#states names where to look for {status.state.name}",
            )
        elif isinstance(sample, InputsSample) and name in sample.triggered:
            yield Finding(
                "triggered",
                f"{name} has triggered, and the robot does not drive against that.",
                "free it; if nothing is there, look at its wire: a broken one counts as pressed",
            )
        elif isinstance(sample, PowerSample) and sample.level > BatteryLevel.OK:
            yield Finding(
                "battery",
                f"{sentence_of_event(name, SensorEventCode.BATTERY, sample.level)}.",
                f"charge it; it has {sample.voltage_v:.2f} V",
            )
