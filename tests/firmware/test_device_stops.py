"""What a device says of its stops by itself: boxes, ledger, and how it stands."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from wheelwire.diagnosis.device import DatedStop, ledger_facts, stops_of_device
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.errors import DeviceRefused
from wheelwire.link.stored_boxes import Recorded
from wheelwire_protocol.codes import Group, ResetReason, SupervisorState
from wheelwire_protocol.types import GROUP_HASHES

STORED_S = 15.0
"""A box is in flash by then: not within ten seconds of a start, and then at rest."""


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
    return stops_of_device(robot.info.device, robot.read(), recorded)


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


def test_before_the_box_is_stored_the_flags_alone_speak(robot: VirtualMockDriver) -> None:
    block(robot)
    assert causes(robot) == ["encoder_dead or wheel_blocked"]


def test_a_stop_behind_the_newest_box_is_not_taken_for_it(robot: VirtualMockDriver) -> None:
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
        "contact_open or estop_by_session or estop_by_stranger",
    ]


@pytest.mark.parametrize("reason", [ResetReason.PANIC, ResetReason.TASK_WATCHDOG])
def test_a_reset_is_told_by_its_box(robot: VirtualMockDriver, reason: ResetReason) -> None:
    drive(robot, 1.0)
    robot.simulator.reset(reason)
    robot.advance(2.0)
    assert causes(robot) == [reason.name.lower()]
    robot.advance(STORED_S)
    (found,) = stops(robot)
    assert found.stop.cause == reason.name.lower()
    # Its clock was the one before the reset, which nobody knows.
    assert not found.is_dated
    assert "before the reset" in " ".join(found.stop.evidence)


Damage = Callable[[bytes], bytes]


def flipped(image: bytes) -> bytes:
    return image[:5000] + bytes([image[5000] ^ 1]) + image[5001:]


def damaged(robot: VirtualMockDriver, damage: Damage = flipped) -> list[DatedStop]:
    """The stops, where flash has changed each box since it was stored."""
    recorded = robot.recorder.read()
    boxes = [(stored, damage(image)) for stored, image in recorded.boxes]
    return stops_of_device(robot.info.device, robot.read(), recorded._replace(boxes=boxes))


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


def test_a_damaged_box_of_a_fault_that_is_cleared_says_that_it_is_lost(
    robot: VirtualMockDriver,
) -> None:
    block(robot)
    robot.simulator.set("left.blocked", 0)
    robot.clear_fault()
    robot.advance(STORED_S)
    (found,) = damaged(robot)
    assert found.stop.cause == "box_damaged"


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


def test_a_power_cut_leaves_the_boxes(robot: VirtualMockDriver) -> None:
    block(robot)
    robot.advance(STORED_S)
    robot.simulator.reset(ResetReason.POWER_ON)
    robot.simulator.set("left.blocked", 0)
    robot.advance(3.0)
    found = stops(robot)
    assert [one.stop.cause for one in found] == ["wheel_blocked"]
    assert not found[0].is_dated


def test_a_robot_that_drives_says_to_stop_it(robot: VirtualMockDriver) -> None:
    drive(robot, 0.5)
    recorded = robot.recorder.read()
    assert recorded == Recorded(why_none="the robot drives: stop it to read its black boxes")
    assert stops(robot) == []


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
    assert causes(robot) == ["contact_open or estop_by_session or estop_by_stranger"]


def test_the_ledger_in_words(robot: VirtualMockDriver) -> None:
    drive(robot, 0.5)
    robot.estop()
    robot.advance(1.0)
    ledger = robot.recorder.read(boxes=False).ledger
    assert ledger is not None
    facts = ledger_facts(ledger)
    assert facts["stops in its life"] == "emergency stops 1"
    assert facts["starts in its life"] == "POWER_ON 1"
