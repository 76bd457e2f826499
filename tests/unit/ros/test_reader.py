from __future__ import annotations

import queue
import threading
import time
from typing import Any, cast

import pytest

from support.host_samples import sample
from wheelwire import BaseDriver, LinkClosed, LinkLost, RequestTimeout, WheelSample, WheelwireError
from wheelwire_ros.reader import UNEXPLAINED_S, SampleReader, sampling_rate_hz

TIMEOUT_S = 30.0


class ScriptedRobot:
    """Reads what it was given, in order; then nothing. It is its own iterator over all samples."""

    dropped = 3
    silence_s = 0.0
    """How long nothing comes before it says why."""

    def __init__(self, *script: Any) -> None:
        self._script = list(script)
        self._came: list[WheelSample] = []

    def samples(self) -> ScriptedRobot:
        return self

    def poll(self) -> WheelSample | None:
        return self._came.pop(0) if self._came else None

    def is_ready(self) -> bool:
        return bool(self._came)

    def wait(self, timeout: float) -> bool:
        assert timeout > 0
        while self._script and not isinstance(self._script[0], Exception):
            step = self._script.pop(0)
            self._came += step if isinstance(step, list) else [step]
        return self.is_ready()

    def read(self, timeout: float) -> WheelSample:
        assert timeout > 0
        if not self._script:
            raise LinkLost("the end")
        time.sleep(self.silence_s)
        raise self._script.pop(0)


def events(*script: Any, count: int) -> list[Any]:
    """The first `count` calls of a reader; samples in a list come together with the one before."""
    seen: queue.Queue[Any] = queue.Queue()
    robot = cast("BaseDriver", ScriptedRobot(*script))
    reader = SampleReader(robot, seen.put, lambda: seen.put("change"), seen.put)
    reader.begin()
    try:
        return [seen.get(timeout=TIMEOUT_S) for _ in range(count)]
    finally:
        reader.close()


def test_a_silence_its_end_and_another_boot_are_changes() -> None:
    one, two, three = sample(t_us=1), sample(t_us=2), sample(t_us=3)
    other = sample(boot_id=2)
    silence = LinkLost("silent"), LinkLost("silent"), LinkLost("gone")
    script = (one, two, *silence, three, other)
    expected = ["change", one, two, "change", "change", "change", three, "change", other]
    assert events(*script, count=len(expected)) == expected


def test_samples_that_come_together_are_all_handed_over() -> None:
    one, two, three = sample(t_us=1), sample(t_us=2), sample(t_us=3)
    assert events(one, [two, three], count=4) == ["change", one, two, three]


def test_a_silence_is_reported_when_its_cause_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """A link that is lost without a sign finds that out a moment after the last sample."""
    monkeypatch.setattr(ScriptedRobot, "silence_s", 0.9 * UNEXPLAINED_S)
    one, unexplained = sample(t_us=1), RequestTimeout("no sample")
    told = events(one, unexplained, LinkLost("the robot does not answer"), count=3)
    assert told == ["change", one, "change"]
    assert events(one, unexplained, sample(t_us=2), count=3) == ["change", one, sample(t_us=2)]
    assert events(one, unexplained, unexplained, count=3) == ["change", one, "change"]


def test_a_device_that_was_flashed_with_another_release_is_a_silence_too() -> None:
    one, two = sample(t_us=1), sample(t_us=2)
    script = (one, WheelwireError("host and firmware do not match"), two)
    assert events(*script, count=5) == ["change", one, "change", "change", two]


def test_a_link_that_is_down_for_good_is_no_silence() -> None:
    one, closed = sample(t_us=1), LinkClosed("its thread failed")
    assert events(one, closed, count=3) == ["change", one, closed]


def test_what_fails_is_handed_over() -> None:
    error = RuntimeError("a defect")
    assert events(sample(), error, count=3)[-1] is error


class WaitingRobot(ScriptedRobot):
    """A sample comes only once the reader is to end."""

    def __init__(self) -> None:
        super().__init__()
        self.is_waited_for = threading.Event()
        self.comes = threading.Event()

    def wait(self, timeout: float) -> bool:
        assert timeout > 0
        self.is_waited_for.set()
        assert self.comes.wait(TIMEOUT_S)
        self._came.append(sample())
        return True


def test_no_sample_is_handed_over_after_the_end() -> None:
    seen: list[Any] = []
    robot = WaitingRobot()
    reader = SampleReader(cast("BaseDriver", robot), seen.append, lambda: None, seen.append)
    reader.begin()
    assert robot.is_waited_for.wait(TIMEOUT_S)
    closing = threading.Thread(target=reader.close)
    closing.start()
    while not reader._closing.is_set():
        time.sleep(0.001)
    robot.comes.set()
    closing.join(TIMEOUT_S)
    assert not closing.is_alive()
    assert not reader._thread.is_alive()
    assert seen == []


@pytest.mark.parametrize(
    ("publish_rate_hz", "expected_hz"), [(1.0, 8), (2.5, 9), (3.0, 9), (8.0, 8), (49.5, 50)]
)
def test_the_robot_measures_a_multiple_of_the_rate_and_never_too_seldom(
    publish_rate_hz: float, expected_hz: int
) -> None:
    assert sampling_rate_hz(publish_rate_hz) == expected_hz
