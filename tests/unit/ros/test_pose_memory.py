from __future__ import annotations

import json
import logging
import math
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import Point, Pose, Quaternion

from support.cases import each
from support.host_samples import sample
from support.waiting import wait_until
from wheelwire import DifferentialDrive
from wheelwire_ros import pose_memory
from wheelwire_ros.motion_estimator import MotionEstimator, PoseRecord
from wheelwire_ros.pose_memory import MOVED_M, MOVED_RAD, PoseFileError, PoseMemory, how_far_off

LOG = logging.getLogger("test")
DRIVE = DifferentialDrive(0.2, 0.05, 1000, max_velocity_mps=0.4)
RECORD = PoseRecord(
    board_id="0123456789ab",
    boot_id=7,
    t_us=10**6,
    left_ticks=2**32 - 100,
    right_ticks=50,
    left_total=-3,
    right_total=4,
    pose=(1.0, 2.0, 3.0),
    covariance=(0.01, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.03),
    saved_s=1e9,
)


def test_the_pose_is_read_as_written(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "pose.json"
    assert pose_memory.read(path) is None
    pose_memory.write(path, RECORD)
    assert pose_memory.read(path) == RECORD
    assert list(path.parent.iterdir()) == [path]


@each("text", ["", "{", '{"format": 1}', '{"format": 99}', "[]"])
def test_another_file_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "pose.json"
    path.write_text(text)
    with pytest.raises(PoseFileError, match=r"pose\.json: it is not a pose file"):
        pose_memory.read(path)


@each(
    "change",
    [
        {"pose": (1.0, 2.0)},
        {"pose": (1.0, 2.0, math.nan)},
        {"covariance": (-1.0, *RECORD.covariance[1:])},
        {"boot_id": 1.5},
        {"boot_id": True},
        {"board_id": 7},
        {"is_final": 1},
        {"saved_s": math.inf},
    ],
)
def test_an_impossible_value_is_refused_with_the_files_name(
    tmp_path: Path, change: dict[str, object]
) -> None:
    path = tmp_path / "pose.json"
    pose_memory.write(path, replace(RECORD, **change))  # type: ignore[arg-type]
    with pytest.raises(PoseFileError, match=r"pose\.json: it is not a pose file"):
        pose_memory.read(path)


def test_each_name_and_board_has_a_file_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    folder = tmp_path / "wheelwire"
    assert pose_memory.path_of("auto", "/a/robot", "01") == folder / "a.robot-01.pose.json"
    assert pose_memory.path_of("auto", "/robot", "") == folder / "robot.pose.json"
    assert pose_memory.path_of("", "/robot", "01") is None
    assert pose_memory.path_of("/x/y", "/robot", "01") == Path("/x/y")


def test_the_ticks_since_are_one_arc_also_across_a_wrap() -> None:
    motions = MotionEstimator(DRIVE, wheel_variance_m=1e-4)
    first = sample(boot_id=7, t_us=5 * 10**6, left_ticks=900, right_ticks=1050)
    update = motions.resume(RECORD, first)
    assert update.distance_m == pytest.approx(2 * math.pi * 0.05)
    motion = motions.update(first._replace(t_us=6 * 10**6))
    assert motion.pose.x_m == pytest.approx(1.0 + update.distance_m * math.cos(3.0))
    assert motion.left.angle_rad == pytest.approx(997 / 1000 * 2 * math.pi)
    assert np.all(np.diag(motion.covariance) > np.diag(np.reshape(RECORD.covariance, (3, 3))))


def test_a_record_of_another_boot_is_where_it_begins() -> None:
    motions = MotionEstimator(DRIVE, wheel_variance_m=1e-4)
    motions.resume_after_reset(RECORD, 0.5, 0.2)
    motion = motions.update(sample(boot_id=8, left_ticks=5, right_ticks=5))
    assert tuple(motion.pose) == RECORD.pose
    assert np.diag(motion.covariance) == pytest.approx((0.26, 0.27, 0.07))
    assert motions.rebases == 0


def test_the_ticks_of_another_board_are_not_saved_as_this_ones(tmp_path: Path) -> None:
    path, board, motions = tmp_path / "pose.json", ["01"], MotionEstimator(DRIVE, 1e-4)
    memory = PoseMemory(path, lambda: board[0], motions, {}, LOG)
    memory.open(sample(boot_id=1), 1.0)
    motions.update(sample(boot_id=1, left_ticks=10))
    board[0] = "02"
    motions.update(sample(boot_id=2, left_ticks=500))
    memory.close()
    found = pose_memory.read(path)
    assert found is None or found.boot_id == 1


def test_the_file_is_replaced_whole_once_a_period_and_only_after_a_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pose_memory, "PERIOD_S", 0.05)
    path, motions = tmp_path / "pose.json", MotionEstimator(DRIVE, 1e-4)
    memory = PoseMemory(path, lambda: "01", motions, {}, LOG)
    motions.update(sample())
    memory.open(sample(), 1.0)
    wait_until(path.exists, 10.0, "the file")
    files: dict[int, str] = {}
    begin_s = time.monotonic()
    for step in range(200):  # it drives
        motions.update(sample(left_ticks=step, t_us=step))
        files[path.stat().st_mtime_ns] = path.read_text()
        time.sleep(0.002)
    periods = (time.monotonic() - begin_s) / pose_memory.PERIOD_S
    assert 3 <= len(files) <= periods + 2
    assert all(json.loads(text)["format"] == 1 for text in files.values())
    assert not any(json.loads(text)["is_final"] for text in files.values())
    time.sleep(3 * pose_memory.PERIOD_S)
    rest = path.stat().st_mtime_ns
    motions.update(sample(left_ticks=199, t_us=10**6))  # only its clock goes on
    time.sleep(3 * pose_memory.PERIOD_S)
    assert path.stat().st_mtime_ns == rest
    memory.close()
    assert json.loads(path.read_text())["is_final"]


def test_an_unwritable_folder_is_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(pose_memory, "PERIOD_S", 0.001)
    (tmp_path / "file").touch()
    path, motions = tmp_path / "file" / "pose.json", MotionEstimator(DRIVE, 1e-4)
    memory = PoseMemory(path, lambda: "01", motions, {}, LOG)
    tries = Mock(wraps=pose_memory.write)
    monkeypatch.setattr(pose_memory, "write", tries)
    memory.open(sample(), 1.0)
    motions.update(sample())
    wait_until(lambda: tries.call_count > 3, 10.0, "attempts to write")
    memory.close()
    assert caplog.text.count("without it a restart loses the pose") == 1


@each(
    ("is_final", "age_s", "off_m", "turn_rad"),
    [
        (True, 0.0, MOVED_M, MOVED_RAD),
        # By hand: 0.4 m/s for the time, and the wheels 0.2 m apart against each other.
        (False, 0.3, 0.12, 1.2),
        (False, 0.5, 0.2, 2.0),
        (False, 3600.0, 0.8, math.pi),  # a second until the next record, and one of driving
    ],
)
def test_how_far_a_robot_may_have_turned_is_twice_the_way_over_the_separation(
    monkeypatch: pytest.MonkeyPatch, is_final: bool, age_s: float, off_m: float, turn_rad: float
) -> None:
    monkeypatch.setattr("time.time", lambda: RECORD.saved_s + age_s)
    found = how_far_off(replace(RECORD, is_final=is_final), DRIVE, 1.0)
    assert found == pytest.approx((off_m, turn_rad), rel=1e-5)


@each("degrees", [0, 30, 90, 179, -90, -179])
def test_a_heading_is_the_turn_of_its_quaternion(degrees: float) -> None:
    half = math.radians(degrees) / 2
    message = Pose(
        position=Point(x=1.0, y=-2.0), orientation=Quaternion(z=math.sin(half), w=math.cos(half))
    )
    place = pose_memory.planar_pose(message)
    assert place == pytest.approx((1.0, -2.0, math.radians(degrees)))
