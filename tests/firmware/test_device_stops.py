"""What a device says of its stops by itself: boxes, ledger, and how it stands."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.errors import DeviceRefused
from wheelwire.log.why.device import DatedStop, ledger_facts, stops_of_device
from wheelwire_protocol.codes import Group, ResetReason, SupervisorState
from wheelwire_protocol.types import GROUP_HASHES

STORED_S = 15.0
"""By then a box is in flash: it is written at rest, ten seconds after a start."""


@pytest.fixture
def robot() -> Iterator[VirtualMockDriver]:
    with VirtualMockDriver(realtime=False) as driver:
        driver.simulator.set("supply_ohm", 0.4)
        yield driver


def drive(robot: VirtualMockDriver, seconds: float) -> None:
    for _ in range(round(seconds / 0.05)):
        with suppress(DeviceRefused):
            robot.set_velocity(0.2, 0.2)
        robot.advance(0.05)


def stops(robot: VirtualMockDriver) -> list[DatedStop]:
    recorded = robot.recorder.read()
    return stops_of_device(robot.info.device, robot.read(), recorded, robot.holding())


def causes(robot: VirtualMockDriver) -> list[str]:
    return [one.stop.cause for one in stops(robot)]


def block(robot: VirtualMockDriver) -> None:
    drive(robot, 1.0)
    robot.simulator.set("left.blocked", 1)
    drive(robot, 3.0)
    assert robot.read().state is SupervisorState.FAULT


def test_the_box_of_how_it_stands_says_it_once(robot: VirtualMockDriver) -> None:
    block(robot)
    robot.advance(STORED_S)
    (found,) = stops(robot)
    assert found.stop.cause == "wheel_blocked"
    # A host was there: the stop has a time on its clock.
    assert found.is_dated
    age_s = robot.read().stamp - found.stop.host_us / 1e6
    assert STORED_S < age_s < STORED_S + 6.0


def test_a_stop_after_the_newest_box_is_not_mistaken_for_it(robot: VirtualMockDriver) -> None:
    for _ in range(3):
        drive(robot, 0.5)
        robot.estop()
        robot.advance(STORED_S)
        robot.clear_estop()
        robot.advance(1.0)
    # Three boxes at once are all that the flash is worn by; the next one waits.
    robot.simulator.set("estop_open", 1)
    robot.advance(STORED_S)
    assert causes(robot) == [
        *["estop_by_session"] * 3,
        "contact_open",
    ]


RESET_CAUSES: dict[ResetReason, list[str]] = {
    ResetReason.UNKNOWN: ["reset_unknown"],
    ResetReason.POWER_ON: [],  # as robots start
    ResetReason.EXTERNAL: [],
    ResetReason.SOFTWARE: ["restart_requested or restarted_itself"],
    ResetReason.PANIC: ["panic"],
    ResetReason.TASK_WATCHDOG: ["task_watchdog"],
    ResetReason.INTERRUPT_WATCHDOG: ["interrupt_watchdog"],
    ResetReason.BROWNOUT: ["brownout"],
}
LEAVE_A_BOX = ResetReason.PANIC, ResetReason.TASK_WATCHDOG, ResetReason.INTERRUPT_WATCHDOG


@pytest.mark.parametrize("drives", [True, False])
@pytest.mark.parametrize("reason", ResetReason)
def test_a_reset_of_each_kind_is_reported(
    robot: VirtualMockDriver, reason: ResetReason, *, drives: bool
) -> None:
    drive(robot, 1.0)
    if not drives:
        robot.stop()
        robot.advance(2.0)
    robot.simulator.reset(reason)
    robot.advance(2.0)
    assert causes(robot) == RESET_CAUSES[reason]
    robot.advance(STORED_S)
    found = stops(robot)
    assert [one.stop.cause for one in found] == RESET_CAUSES[reason]
    # Its clock was the one before the reset, which is unknown.
    assert not any(one.is_dated for one in found)
    evidence = " ".join(text for one in found for text in one.stop.evidence)
    assert ("before the reset" in evidence) == (reason in LEAVE_A_BOX)


def test_a_supply_that_dips_is_a_brown_out(robot: VirtualMockDriver) -> None:
    robot.simulator.set("supply_ohm", 2.0)
    robot.simulator.set("brownout_v", 6.0)
    drive(robot, 1.0)
    robot.simulator.set("left.blocked", 1)
    boot_id = robot.info.device.boot_id
    for _ in range(400):
        drive(robot, 0.05)
        if robot.info.device.boot_id != boot_id:
            break
    robot.simulator.set("left.blocked", 0)
    robot.stop()
    robot.advance(1.0)
    assert causes(robot) == ["brownout"]


# --- second days ---------------------------------------------------------------------------------


@pytest.mark.parametrize("reason", LEAVE_A_BOX)
def test_a_reset_before_a_fault_s_box_is_stored_costs_neither(
    robot: VirtualMockDriver, reason: ResetReason
) -> None:
    block(robot)
    robot.simulator.reset(reason)
    robot.simulator.set("left.blocked", 0)
    robot.advance(STORED_S)
    found = stops(robot)
    assert [one.stop.cause for one in found] == ["wheel_blocked", reason.name.lower()]
    assert not any("its last control step" in text for text in found[1].stop.evidence)


@pytest.mark.parametrize("latch", ["fault", "estop"])
def test_a_cause_from_an_earlier_boots_box_is_not_guessed_again(
    robot: VirtualMockDriver, latch: str
) -> None:
    if latch == "fault":
        block(robot)
    else:
        drive(robot, 1.0)
        robot.estop()
    robot.advance(STORED_S)
    robot.simulator.set("left.blocked", 0)
    robot.simulator.reset(ResetReason.PANIC)
    robot.advance(25.0)
    stopped = "wheel_blocked" if latch == "fault" else "estop_by_session"
    found = stops(robot)
    assert [one.stop.cause for one in found] == [stopped, "panic", f"{latch}_before_reset"]
    assert "black box 1, of an earlier boot" in found[-1].stop.evidence[-1]
    # A new latch has its own box.
    (robot.clear_fault if latch == "fault" else robot.clear_estop)()
    robot.estop()
    robot.advance(STORED_S)
    assert causes(robot) == [stopped, "panic", "estop_by_session"]


Damage = Callable[[bytes], bytes]


def flipped(image: bytes) -> bytes:
    return image[:5000] + bytes([image[5000] ^ 1]) + image[5001:]


def damaged(robot: VirtualMockDriver, damage: Damage = flipped) -> list[DatedStop]:
    """The stops, where flash has changed each box since it was stored."""
    recorded = robot.recorder.read()
    boxes = [(stored, damage(image)) for stored, image in recorded.boxes]
    recorded = recorded._replace(boxes=boxes)
    return stops_of_device(robot.info.device, robot.read(), recorded, robot.holding())


@pytest.mark.parametrize("damage", [flipped, lambda image: b"\xff" * len(image), lambda _: b""])
def test_a_damaged_box_is_named_and_its_head_tells_on(
    robot: VirtualMockDriver, damage: Damage
) -> None:
    block(robot)
    robot.advance(STORED_S)
    (found,) = damaged(robot, damage)
    assert found.stop.cause == "encoder_dead or wheel_blocked"
    assert found.stop.sentence.startswith("Left wheel")
    assert "black box 1 of boot" in found.stop.evidence[0]
    assert "cannot be read" in found.stop.evidence[0]
    assert "LEFT_NOT_COUNTING" in " ".join(found.stop.evidence)
    assert found.is_dated


def test_a_damaged_box_of_an_estop_or_a_reset_is_named(robot: VirtualMockDriver) -> None:
    robot.estop()
    robot.advance(STORED_S)
    (found,) = damaged(robot)
    assert found.stop.cause == "contact_open or estop_by_session or estop_by_stranger"
    robot.clear_estop()
    drive(robot, 1.0)
    robot.simulator.reset(ResetReason.INTERRUPT_WATCHDOG)
    robot.advance(STORED_S)
    assert [one.stop.cause for one in damaged(robot)][1:] == ["interrupt_watchdog"]


def test_a_device_without_a_recorder_or_of_another_release_has_none(
    robot: VirtualMockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(GROUP_HASHES, Group.RECORDER, 0x0BADBEEF)
    recorded = robot.recorder.read()
    assert recorded.ledger is None
    assert "messages about recorders" in recorded.why_none
    assert "everything else works" in recorded.why_none
    robot.estop()
    robot.advance(0.5)
    assert causes(robot) == ["estop_by_session"]


def test_the_ledger_in_words(robot: VirtualMockDriver) -> None:
    drive(robot, 0.5)
    robot.estop()
    robot.advance(1.0)
    ledger = robot.recorder.read(boxes=False).ledger
    assert ledger is not None
    facts = ledger_facts(ledger)
    # The first one is that of the opening.
    assert facts["stops in its life"] == "ended by a stop 1, emergency stops 1"
    assert facts["starts in its life"] == "POWER_ON 1"
