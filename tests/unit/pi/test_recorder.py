"""A robot on this computer's pins has a black box and a ledger, in a file that outlives it."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import pytest

from support.full_disk import no_space
from support.library_robot import LibraryRobot
from wheelwire.errors import WheelwireError
from wheelwire.log.why.black_box import stops_of_box
from wheelwire.pi.core import make_core
from wheelwire.pi.guard import Heartbeat
from wheelwire.pi.pins import Pins
from wheelwire.pi.settings import McuSettings
from wheelwire.pi.storage import RecorderFile, keep_recorder, recorder_path
from wheelwire_protocol.black_box import BOX_SIZE, Box, BoxError, RerunOutcome
from wheelwire_protocol.codes import BoxCause, Fault, SupervisorState
from wheelwire_protocol.core import RECORDER_SIZE
from wheelwire_protocol.types import BoxGet, BoxValue, ClearEstop

STORED_S = 15.0
"""By then a box is in the file: it is written at rest, ten seconds after a start."""
TICKS_PER_S = 400


class PinsRobot(LibraryRobot):
    """The core as the process on a Pi runs it, in virtual time, with a host on its line."""

    def __init__(self, settings: McuSettings) -> None:
        super().__init__(make_core(settings))
        keep_recorder(self.core, settings, Heartbeat())
        self.left_counts = True
        self.open()

    def drive(self, seconds: float) -> None:
        end_us = self.now_us + seconds * 1e6
        while self.now_us < end_us:
            with suppress(WheelwireError):
                self.set_velocity(0.2, 0.2, 0.3)
            ticks = TICKS_PER_S * self.outputs.period_us // 1_000_000
            self.left_ticks += ticks * self.left_counts
            self.right_ticks += ticks
            self.step()


def settings_in(folder: Path) -> McuSettings:
    return McuSettings("l298n", Pins(), store=str(folder / "saved"))


def boxes_in(file: Path) -> list[Box]:
    content, found = file.read_bytes(), []
    for start in range(0, RECORDER_SIZE, BOX_SIZE):
        with suppress(BoxError):
            found.append(Box(content[start : start + BOX_SIZE]))
    return found


def test_a_fault_leaves_a_box_that_re_runs_and_says_why(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    robot = PinsRobot(settings)
    robot.drive(2.0)
    robot.left_counts = False
    robot.drive(3.0)
    assert robot.outputs.state is SupervisorState.FAULT
    robot.run(STORED_S)
    (box,) = boxes_in(recorder_path(settings))
    assert (box.head.cause, box.head.faults) == (BoxCause.FAULT, Fault.LEFT_NOT_COUNTING)
    assert box.head.board == settings.board.fingerprint()
    rerun = box.rerun()
    assert rerun.outcome is RerunOutcome.SAME
    assert rerun.last_us - rerun.first_us > 1_000_000
    (stop,) = stops_of_box(box)
    assert stop.sentence.startswith("Left wheel")


def test_boxes_outlive_the_process_and_hosts_read_them(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    for number in (1, 2):
        robot = PinsRobot(settings)
        robot.request(ClearEstop(0, 0))  # it is latched from the process before
        robot.drive(0.5)
        robot.estop()
        robot.run(STORED_S)
        newest = robot.request(BoxGet(0, 0, 0))
        assert isinstance(newest, BoxValue)
        assert (newest.box_count, newest.number, newest.cause) == (number, number, BoxCause.ESTOP)
    assert sorted(box.head.number for box in boxes_in(recorder_path(settings))) == [1, 2]


def test_nothing_is_written_while_it_drives(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    robot = PinsRobot(settings)
    before = recorder_path(settings).read_bytes()
    robot.drive(STORED_S)
    assert robot.outputs.state is SupervisorState.DRIVING
    assert recorder_path(settings).read_bytes() == before
    robot.run(STORED_S)
    assert recorder_path(settings).read_bytes() != before


def test_without_a_store_it_lasts_as_long_as_the_computer_runs() -> None:
    settings = McuSettings("l298n", Pins())
    PinsRobot(settings)
    assert recorder_path(settings).stat().st_size == RECORDER_SIZE


@pytest.mark.parametrize("content", [b"", b"other", bytes(RECORDER_SIZE + 1)])
def test_a_file_that_is_no_recorder_is_started_again(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "recorder"
    path.write_bytes(content)
    file = RecorderFile(path, Heartbeat())
    assert file.content == path.read_bytes() == b"\xff" * RECORDER_SIZE
    assert file.write(4096, b"mine")
    assert RecorderFile(path, Heartbeat()).content[4095:4101] == b"\xffmine\xff"


def test_a_robot_without_a_place_for_it_drives_and_says_so(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    settings = settings_in(tmp_path)
    recorder_path(settings).mkdir()
    robot = PinsRobot(settings)
    robot.drive(0.5)
    assert robot.outputs.state is SupervisorState.DRIVING
    assert "no black box is stored" in capfd.readouterr().err


def test_a_disk_that_refuses_is_reported_and_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    robot = PinsRobot(settings_in(tmp_path))
    monkeypatch.setattr(os, "pwrite", no_space)
    robot.estop()
    robot.run(STORED_S)
    assert robot.outputs.state is SupervisorState.ESTOPPED
    assert "No space left on device" in capfd.readouterr().err
