"""A device's black boxes and ledger, read by a host."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.errors import DeviceRefused, LinkLost, RecordingError, RequestTimeout
from wheelwire.link.requests import Answer, RequestMessage
from wheelwire.robot.black_boxes import AwaitableRecorder, StoredBox
from wheelwire_protocol.black_box import BOX_SIZE, Box, RerunOutcome
from wheelwire_protocol.codes import BoxCause, ResetReason, SupervisorEvent, SupervisorState

STORED_S = 15.0
"""By then a box is in flash: it is written at rest, ten seconds after a start."""


@pytest.fixture
def robot() -> Iterator[VirtualMockDriver]:
    with VirtualMockDriver(realtime=False) as driver:
        yield driver


def drive(robot: VirtualMockDriver, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        robot.set_velocity(0.2, 0.2)
        robot.advance(0.1)


def estop(robot: VirtualMockDriver) -> None:
    """Drive into an e-stop, wait until its box is stored, and clear it."""
    drive(robot, 0.5)
    robot.estop()
    robot.advance(STORED_S)
    robot.clear_estop()
    robot.advance(1.0)


def test_a_box_is_read_and_re_runs(robot: VirtualMockDriver) -> None:
    assert robot.recorder.boxes() == []
    estop(robot)
    (stored,) = robot.recorder.boxes()
    assert (stored.head.number, stored.head.cause) == (1, BoxCause.ESTOP)
    assert stored.head.boot_id == robot.info.device.boot_id
    box = Box(robot.recorder.read_box(stored))
    assert box.head == stored.head
    assert box.rerun().outcome is RerunOutcome.SAME


def test_while_the_robot_drives_it_says_to_stop_first(robot: VirtualMockDriver) -> None:
    estop(robot)
    (stored,) = robot.recorder.boxes()
    drive(robot, 0.2)
    assert robot.read().state is SupervisorState.DRIVING
    for ask in (
        robot.recorder.boxes,
        robot.recorder.ledger,
        lambda: robot.recorder.read_box(stored),
    ):
        with pytest.raises(DeviceRefused, match=r"Not possible while driving.*stop"):
            ask()


@pytest.mark.parametrize("event", ["reset", "unplug"])
def test_what_comes_in_the_middle_of_reading_costs_that_call_alone(
    robot: VirtualMockDriver, event: str
) -> None:
    estop(robot)
    (stored,) = robot.recorder.boxes()
    whole = robot.recorder.read_box(stored)
    ask = robot._link.request
    asked = 0

    def and_then(message: RequestMessage) -> Answer:
        nonlocal asked
        asked += 1
        if asked == 300:
            if event == "reset":
                robot.simulator.reset(ResetReason.TASK_WATCHDOG)
            else:
                robot.unplug()
        return ask(message)

    robot._link.request = and_then  # type: ignore[method-assign]
    with pytest.raises((LinkLost, RequestTimeout)):
        robot.recorder.read_box(stored)
    robot.plug()
    robot.advance(3.0)
    assert robot.recorder.read_box(stored) == whole


def test_a_box_that_is_stored_while_others_are_read_is_read_too(
    robot: VirtualMockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    estop(robot)
    read_box = AwaitableRecorder.read_box
    asked: list[int] = []

    async def and_then(recorder: AwaitableRecorder, box: StoredBox) -> bytes:
        asked.append(box.head.number)
        if len(asked) == 1:
            estop(robot)
            raise RecordingError("it is no longer there")
        return await read_box(recorder, box)

    monkeypatch.setattr(AwaitableRecorder, "read_box", and_then)
    boxes = robot.recorder.read().boxes
    assert [stored.head.number for stored, _ in boxes] == [1, 2]
    assert all(Box(image).head == stored.head for stored, image in boxes)
    assert sorted(asked) == [1, 1, 2]  # none is read in vain


def test_a_box_that_flash_does_not_give_is_empty_and_costs_no_other(
    robot: VirtualMockDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    estop(robot)
    estop(robot)
    read_box = AwaitableRecorder.read_box

    async def fail(recorder: AwaitableRecorder, box: StoredBox) -> bytes:
        if box.head.number == 1:
            raise RecordingError("flash does not answer")
        return await read_box(recorder, box)

    monkeypatch.setattr(AwaitableRecorder, "read_box", fail)
    (_, first), (_, second) = robot.recorder.read().boxes
    assert first == b""
    assert len(second) == BOX_SIZE


def test_boxes_and_ledger_outlive_the_simulator(tmp_path: Path) -> None:
    store = tmp_path / "store"
    with VirtualMockDriver(realtime=False, store=store) as robot:
        estop(robot)
        whole = robot.recorder.read_box(robot.recorder.boxes()[0])
    with VirtualMockDriver(realtime=False, store=store) as robot:
        (stored,) = robot.recorder.boxes()
        assert robot.recorder.read_box(stored) == whole
        assert not stored.is_current
        ledger = robot.recorder.ledger()
        assert ledger.resets[ResetReason.POWER_ON] == 2
        assert ledger.stops[SupervisorEvent.ESTOP] == 1


def test_a_recorder_file_that_cannot_be_written_costs_the_boxes_alone(tmp_path: Path) -> None:
    store = tmp_path / "store"
    store.with_name("store.recorder").mkdir()
    with VirtualMockDriver(realtime=False, store=store) as robot:
        estop(robot)
        assert robot.recorder.boxes() == []
        assert robot.recorder.ledger().stops[SupervisorEvent.ESTOP] == 1
        drive(robot, 0.3)
