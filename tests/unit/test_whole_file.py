"""What the library writes is whole, or is not there: the disk may be full at any byte."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from support.cases import each
from support.forking import forked
from support.full_disk import full_disk
from wheelwire.cli.output import check_writable, write_new
from wheelwire.cli.why import _write_box
from wheelwire.errors import OutputFailed
from wheelwire.link.sharing_folder import SharingFolder, note_driver
from wheelwire.log.plot import Trace
from wheelwire.log.plot import draw as draw_recording
from wheelwire.log.recorder import RecordingFile
from wheelwire.motion.odometry import Pose
from wheelwire.pi.guard import Heartbeat
from wheelwire.pi.storage import RecorderFile
from wheelwire.tools.demo.display import save_trajectory
from wheelwire.tools.files.parameters import ParameterFile
from wheelwire.tools.setup.setup import Progress, _write
from wheelwire.tools.support import _written
from wheelwire.tools.tune.before_after import draw as draw_drives
from wheelwire.whole_file import write_whole

CONTENT = bytes(1000)
POSES = (Pose(0.0, 0.0, 0.0), Pose(1.0, 0.0, 0.0))


def archive(path: Path) -> None:
    with _written(path) as zipped:
        zipped.writestr("a", "b")


WRITERS: dict[str, Callable[[Path], object]] = {
    "content": lambda path: write_whole(path, CONTENT),
    "new file": lambda path: write_new(path, CONTENT),
    "recording": lambda path: RecordingFile(path, 0, {}),
    "parameters of a set-up": lambda path: _write(path, ParameterFile({"path_gain": 1.0})),
    "progress of a set-up": lambda path: Progress("id", path.parent).save({"tune": {"a": 1.0}}),
    "black box": lambda path: _write_box(path, CONTENT),
    "recorder of a Pi": lambda path: RecorderFile(path, Heartbeat()),
    "archive for a bug report": archive,
    "program that drove": lambda path: note_driver(SharingFolder(path.parent, None), "id", 1),
}

PICTURES: dict[str, Callable[[Path], object]] = {
    "picture of a recording": lambda path: draw_recording(Trace(), "", path),
    "picture of drives": lambda path: draw_drives(path, (("a drive", None),)),
    "picture of the demo": lambda path: save_trajectory(path, POSES, POSES, POSES),
}


def check(write: Callable[[Path], object], folder: Path) -> None:
    folder.mkdir()
    with full_disk(), pytest.raises((OSError, OutputFailed)):
        write(folder / "file.png")
    assert not list(folder.iterdir())
    write(folder / "file.png")
    assert [path.stat().st_size > 10 for path in folder.iterdir()] == [True]


@each("name", WRITERS)
def test_on_a_full_disk_nothing_stays_behind(name: str, tmp_path: Path) -> None:
    check(WRITERS[name], tmp_path / name)


@pytest.mark.whole
@each("name", PICTURES)
def test_nor_does_half_a_picture(name: str, tmp_path: Path) -> None:
    check(PICTURES[name], tmp_path / name)


def test_what_was_there_stays_where_it_is(tmp_path: Path) -> None:
    real, link = tmp_path / "real", tmp_path / "link"
    link.symlink_to(real)
    write_whole(link, b"old")
    with full_disk(), pytest.raises(OSError, match="too large"):
        write_whole(link, CONTENT)
    assert real.read_bytes() == b"old"
    write_whole(link, b"new")
    assert (link.is_symlink(), real.read_bytes()) == (True, b"new")


def test_a_pipe_stays_one(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    descriptor = os.open(pipe, os.O_RDWR)
    check_writable(pipe)
    write_whole(pipe, b"all")
    assert os.read(descriptor, 9) == b"all"
    assert pipe.is_fifo()
    os.close(descriptor)


def test_two_programs_may_write_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"

    def another_writes(_descriptor: int) -> None:
        monkeypatch.undo()
        with forked(lambda: write_whole(path, b"another's")):
            assert path.read_bytes() == b"another's"

    monkeypatch.setattr(os, "fsync", another_writes)
    write_whole(path, CONTENT)
    assert path.read_bytes() == CONTENT
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_program_left_is_removed_later(tmp_path: Path) -> None:
    path, left = tmp_path / "file[1]", tmp_path / "file[1].4711.new"
    other = tmp_path / "file1.4711.new"
    for stays in (left, other):
        stays.write_bytes(b"half")
    write_whole(path, CONTENT)
    assert left.exists()  # another program may be writing it
    for old in (left, other):
        os.utime(old, (0, 0))
    write_whole(path, CONTENT)
    assert sorted(tmp_path.iterdir()) == [other, path]
