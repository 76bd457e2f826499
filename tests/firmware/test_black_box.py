"""A simulated robot's black box: read, and run again by the same core."""

from __future__ import annotations

import struct
import zlib
from itertools import pairwise
from pathlib import Path

import pytest

from support.virtual import box_after_a_contact
from wheelwire.errors import RecordingError
from wheelwire.log.why.black_box import read_box, rerun_box
from wheelwire_protocol.black_box import (
    BOX_SIZE,
    Box,
    BoxCause,
    BoxError,
    Contact,
    End,
    Received,
    RerunOutcome,
    Step,
    Transition,
    core_hash,
)


@pytest.fixture(scope="module")
def image() -> bytes:
    return box_after_a_contact()


def test_a_box_says_what_the_robot_was_given_and_did(image: bytes) -> None:
    box = Box(image)
    assert len(image) == BOX_SIZE
    assert box.head.cause is BoxCause.ESTOP
    assert box.head.core == core_hash()
    entries = list(box.entries())
    steps = [entry for entry in entries if isinstance(entry, Step)]
    assert steps[-1].t_us - steps[0].t_us > 1_000_000
    assert {after.t_us - before.t_us for before, after in pairwise(steps)} == {1000}
    assert steps[-1].left_counter > steps[0].left_counter
    assert steps[-1].left_duty_q15 > steps[-1].right_duty_q15 > 0
    assert 6000 < steps[-1].battery_mv < 8000
    assert {type(entry.message).__name__ for entry in entries if isinstance(entry, Received)} >= {
        "SetWheelVelocity",
        "Ping",
    }
    contact, stop, end = entries[-3:]
    assert contact == Contact(steps[-1].t_us, open=True)
    assert isinstance(stop, Transition)
    assert (stop.event.name, stop.after.name) == ("ESTOP", "ESTOPPED")
    assert end == End(steps[-1].t_us + 1000, 0, 0)


def test_a_box_re_runs_the_same(image: bytes) -> None:
    rerun = Box(image).rerun()
    assert rerun.outcome is RerunOutcome.SAME
    assert rerun.steps > 1000


def test_a_file_is_read_and_re_run(image: bytes, tmp_path: Path) -> None:
    path = tmp_path / "stop.box"
    path.write_bytes(image)
    assert read_box(path).head.cause is BoxCause.ESTOP
    assert rerun_box(path).outcome is RerunOutcome.SAME


@pytest.mark.parametrize("content", [b"", b"x" * BOX_SIZE, bytes(100)])
def test_a_file_that_is_no_box_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.bin"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="is no black box"):
        read_box(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot read"):
        read_box(tmp_path / "none.box")


def test_a_damaged_box_is_refused(image: bytes) -> None:
    with pytest.raises(BoxError, match="damaged"):
        Box(image[:5000] + bytes([image[5000] ^ 1]) + image[5001:])


def of_core(image: bytes, core: int) -> bytes:
    """The box as a device with this core stores it."""
    head = list(struct.unpack("<64I", image[:256]))
    head[4] = core
    head[12] = zlib.crc32(struct.pack("<12I", *head[:12]))
    return struct.pack("<64I", *head) + image[256:]


def test_a_box_of_another_core_is_refused_by_name(image: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.box"
    path.write_bytes(of_core(image, 0xC0FFEE))
    with pytest.raises(RecordingError, match=f"core 00c0ffee .*this is {core_hash():08x}"):
        rerun_box(path)
    assert any(isinstance(entry, End) for entry in read_box(path).entries())
