"""The recorder: what it writes, when it goes on in another file, and how it ends."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from datetime import datetime, timezone
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from support.full_disk import no_space
from support.tapped_line import TappedLine
from support.waiting import wait_until
from wheelwire.errors import RecordingError
from wheelwire.link.session import Session
from wheelwire.link.traffic import Kind
from wheelwire.log import recorder as recorder_module
from wheelwire.log.reader import is_complete, messages, metadata, offset_us, records, was_closed
from wheelwire.log.recorder import Attachment, Recorder
from wheelwire.log.repair import repair
from wheelwire.log.rerun import Rerun
from wheelwire.log.summary import summary

Make = Callable[..., Recorder]


@pytest.fixture
def link() -> TappedLine:
    return TappedLine()


@pytest.fixture
def make(link: TappedLine, tmp_path: Path) -> Iterator[Make]:
    made: list[Recorder] = []

    def record(path: Path = tmp_path / "day.mcap", **options: object) -> Recorder:
        recorder = Recorder(link, path, {"driver": "mock"}, **options)  # type: ignore[arg-type]
        made.append(recorder)
        return recorder

    yield record
    for recorder in made:
        recorder.close()


def samples_of(path: Path) -> tuple[list[object], Session]:
    again = Rerun()
    found = [one.sample() for one in again.feed_all(records(path))]
    assert again.session is not None
    return list(found), again.session


def test_what_the_link_did_is_done_again(link: TappedLine, make: Make) -> None:
    known = len(link.line.samples)
    recorder = make()
    link.drive(3)
    recorder.close()
    samples, session = samples_of(recorder.file)
    assert samples == link.line.samples[known:]
    assert session.reported.values == link.line.session.reported.values
    assert (recorder.lost, recorder.error) == (0, None)
    assert metadata(recorder.file)["driver"] == "mock"
    assert not link.traffic.readers


def test_closing_twice_and_the_links_end(link: TappedLine, make: Make) -> None:
    recorder = make()
    link.drive(0.2)
    link.has_ended = True
    wait_until(lambda: not link.traffic.readers)
    recorder.close()
    recorder.close()
    with recorder.file.open("rb") as file:
        assert make_reader(file).get_summary() is not None
    assert not repair(recorder.file)


def test_viewers_find_messages_that_they_know(link: TappedLine, make: Make) -> None:
    recorder = make()
    link.drive(2)
    link.line.run(1)  # the setpoint expires
    recorder.close()
    found: dict[str, list[object]] = {}
    with recorder.file.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, _, message in reader.iter_decoded_messages():
            assert schema is not None
            assert schema.encoding == "ros2msg"
            found.setdefault(channel.topic, []).append(message)
    last = link.line.samples[-1]
    odometry, joints = found["/odom"][-1], found["/joint_states"][-1]
    assert odometry.header.frame_id == "odom"  # type: ignore[attr-defined]
    assert odometry.pose.pose.position.x > 0.2  # type: ignore[attr-defined]
    assert joints.name == ["left_wheel_joint", "right_wheel_joint"]  # type: ignore[attr-defined]
    assert joints.position[0] > 0  # type: ignore[attr-defined]
    # By the device's clock: none is left out because another came late.
    assert 149 <= len(found["/odom"]) <= 151
    assert len(found["/odom"]) == len(found["/joint_states"]) == len(found["/tf"])
    (transform,) = found["/tf"][-1].transforms  # type: ignore[attr-defined]
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    assert transform.transform.translation.x == odometry.pose.pose.position.x  # type: ignore[attr-defined]
    battery = found.get("/battery_state", [])
    assert len(battery) == (0 if last.battery_v is None else 3)
    said = [(one.level, one.msg) for one in found["/wheelwire/events"]]  # type: ignore[attr-defined]
    assert said == [(20, "DRIVING"), (20, "TIMED_OUT")]


@pytest.mark.parametrize(("limit", "value"), [("MAX_BYTES", 1), ("MAX_S", 0.5)])
def test_a_full_file_goes_on_in_the_next(
    link: TappedLine, make: Make, monkeypatch: pytest.MonkeyPatch, limit: str, value: float
) -> None:
    monkeypatch.setattr(recorder_module, limit, value)
    known = len(link.line.samples)
    recorder = make()
    first = recorder.file
    for _ in range(2):
        before = recorder.file
        while recorder.file == before:
            link.drive(0.1)
            time.sleep(0.05)
    recorder.close()
    files = [first, first.with_name("day-2.mcap"), first.with_name("day-3.mcap")]
    assert recorder.files == files
    assert metadata(files[1])["previous"] == "day.mcap"
    # Each stands by itself, and together they miss nothing.
    found = [sample for file in files for sample in samples_of(file)[0]]
    assert found == link.line.samples[known:]
    numbers = [r.number for file in files for r in records(file)]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_what_is_lost_is_counted_and_the_rest_can_be_done_again(
    link: TappedLine, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "QUEUE", 50)
    monkeypatch.setattr(recorder_module, "PERIOD_S", 0.3)
    recorder = make()
    time.sleep(0.7)
    link.drive(5)
    wait_until(lambda: recorder.lost)
    link.run(0.1)
    time.sleep(0.7)
    known = len(link.line.samples)
    link.run(0.05)
    recorder.close()
    samples, session = samples_of(recorder.file)
    assert samples[-5:] == link.line.samples[known : known + 5]
    assert session.reported.values == link.line.session.reported.values
    kinds = [record.kind for record in records(recorder.file)]
    assert kinds.count(Kind.START) > 1


def test_a_full_disk_ends_the_recording_alone(
    link: TappedLine, make: Make, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    recorder = make()
    link.drive(0.5)
    wait_until(lambda: len(list(records(recorder.file))) > 20)
    written = list(records(recorder.file))
    write, left = os.write, [3000]  # room for a part of a chunk

    def nearly_full(descriptor: int, data: memoryview) -> int:
        size = write(descriptor, data[: left[0]]) if left[0] else no_space()
        left[0] -= size
        return size

    with monkeypatch.context() as patch, caplog.at_level(logging.ERROR, "wheelwire"):
        patch.setattr("wheelwire.log.recorder.os.write", nearly_full)
        link.drive(2)
        wait_until(lambda: recorder.error)
    link.drive(0.5)
    recorder.close()
    assert [record.getMessage() for record in caplog.records] == [
        f"the recording {recorder.file} has ended: No space left on device; the robot still drives"
    ]
    assert not link.traffic.readers
    assert list(records(recorder.file))[: len(written)] == written
    assert repair(recorder.file)
    with recorder.file.open("rb") as file:
        assert make_reader(file).get_summary() is not None


def test_the_next_recording_in_a_folder_repairs_what_a_crash_left(
    link: TappedLine, make: Make, tmp_path: Path
) -> None:
    recorder = make(tmp_path / "whole.mcap")
    link.drive(1)
    recorder.close()
    whole = recorder.file.read_bytes()
    crashed, foreign = tmp_path / "crashed.mcap", tmp_path / "foreign.mcap"
    crashed.write_bytes(whole[: len(whole) // 2])
    foreign.write_bytes(whole[:100].replace(b"wheelwire", b"elsewhere"))
    others = foreign.read_bytes()
    known = list(records(crashed))
    other = make(tmp_path / "other.mcap")
    next_one = make(tmp_path / "next.mcap")  # the other one is being written, and left alone
    wait_until(lambda: crashed.read_bytes().endswith(b"MCAP0\r\n"))
    time.sleep(0.2)  # until it is closed
    assert list(records(crashed)) == known
    assert not repair(crashed)
    assert is_complete(crashed)
    assert not was_closed(crashed)  # why the robot stopped does not change by a repair
    assert was_closed(recorder.file)
    with pytest.raises(RecordingError, match="is being written"):
        repair(other.file)
    assert foreign.read_bytes() == others
    assert recorder.file.read_bytes() == whole
    for one in (other, next_one):
        one.close()
        assert not repair(one.file)


def test_a_folder_gets_a_file_named_by_the_time(make: Make, tmp_path: Path) -> None:
    first, second = make(tmp_path), make(tmp_path)
    assert first.file != second.file
    for one in (first, second):
        assert one.file.parent == tmp_path
        assert one.file.name.startswith("wheelwire-2")
        assert one.file.suffix == ".mcap"


def test_attachments_that_fail_are_the_error_of_a_whole_recording(
    link: TappedLine, make: Make
) -> None:
    threads: list[threading.Thread] = []

    def fail() -> Iterator[Attachment]:
        threads.append(threading.current_thread())
        yield Attachment("a.yaml", "application/yaml", b"b: 1\n")
        raise ValueError("a bug")

    recorder = make(attachments=fail)
    link.drive(0.2)
    wait_until(lambda: bool(threads) and not threads[0].is_alive())
    assert recorder.error is None
    recorder.close()
    assert "a bug" in str(recorder.error)
    with recorder.file.open("rb") as file:
        (found,) = make_reader(file).iter_attachments()
    assert (found.name, found.media_type, found.data) == ("a.yaml", "application/yaml", b"b: 1\n")


def test_without_a_power_cut_nothing_is_older_than_a_chunk(link: TappedLine, make: Make) -> None:
    recorder = make()
    link.drive(0.5)
    newest = link.line.now_us
    # What a kill would leave, a moment later.
    wait_until(
        lambda: max((r.host_us for r in records(recorder.file)), default=0) >= newest - 50_000
    )
    assert any(topic == "/odom" for topic, _, _ in messages(recorder.file))


def test_times_of_day_follow_a_clock_that_is_set(
    link: TappedLine, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a Pi without a battery, once it reaches a time server."""
    years_ns = 10 * 365 * 86_400 * 10**9
    recorder = make()
    before_us = offset_us(recorder.file)
    link.drive(0.5)
    wait_until(lambda: len(list(records(recorder.file))) > 50)
    time_ns = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: time_ns() + years_ns)
    wait_until(lambda: recorder._offset_ns // 1000 - before_us > years_ns // 2000)
    link.drive(0.5)
    recorder.close()
    monkeypatch.undo()
    assert offset_us(recorder.file) - before_us == pytest.approx(years_ns // 1000, abs=1_000_000)
    for topic in ("/wheelwire/received", "/odom"):
        times = [when for name, when, _ in messages(recorder.file) if name == topic]
        assert times[-1] - times[0] == pytest.approx(years_ns, abs=20e9)
    began = datetime.fromisoformat(summary(recorder.file).began)
    assert began.year >= datetime.now(timezone.utc).year + 9
    assert list(records(recorder.file))
    assert is_complete(recorder.file)
