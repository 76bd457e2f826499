from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from unittest.mock import Mock, call

import pytest

from wheelwire_ros.time_base import AHEAD_NS, WAITING_FOR_CLOCK, Offset, TimeBase

OFFSET_NS = 1_700_000_000_123_456_789


class Clocks:
    """Two clocks that advance by 1 us at each look, and the ROS one is OFFSET_NS ahead."""

    def __init__(self, interruptions_ns: list[int]) -> None:
        self.now_ns = 5_000_000_000
        self.offset_ns = OFFSET_NS
        self._interruptions: Iterator[int] = iter(interruptions_ns)

    def monotonic_ns(self) -> int:
        self.now_ns += 1000
        return self.now_ns

    def ros_ns(self) -> int:
        self.now_ns += 1000
        seen = self.now_ns + self.offset_ns
        self.now_ns += next(self._interruptions, 0)
        return seen


@pytest.fixture
def clocks() -> Clocks:
    return Clocks([])


@pytest.fixture
def base(clocks: Clocks) -> TimeBase:
    return TimeBase(clocks.ros_ns, Mock(), clocks.monotonic_ns)


def ros_ns(base: TimeBase, stamp_s: float) -> int:
    converted = base.to_ros_ns(stamp_s)
    assert converted is not None
    return converted


def test_a_monotonic_time_becomes_ros_time(base: TimeBase) -> None:
    assert abs(ros_ns(base, 4.5) - (4_500_000_000 + OFFSET_NS)) <= 1000
    assert base.error_s == 1e-6


def test_an_interrupted_reading_is_not_the_one_that_counts() -> None:
    clocks = Clocks([40_000_000, 30_000_000, 0, 50_000_000, 20_000_000])
    base = TimeBase(clocks.ros_ns, Mock(), clocks.monotonic_ns)
    assert abs(ros_ns(base, 1.0) - (1_000_000_000 + OFFSET_NS)) <= 1000


def test_no_stamp_is_in_the_future_though_the_ros_clock_was_set_back(
    clocks: Clocks, base: TimeBase
) -> None:
    clocks.offset_ns -= 3_000_000_000
    stamp_ns = clocks.now_ns - 1_000_000
    assert abs(ros_ns(base, stamp_ns / 1e9) - (stamp_ns + clocks.offset_ns)) <= 2000
    assert ros_ns(base, clocks.now_ns / 1e9 + 60) <= clocks.ros_ns()


def test_a_step_of_the_ros_clock_is_followed(clocks: Clocks, base: TimeBase) -> None:
    clocks.offset_ns += 3_000_000_000
    base.measure()
    before_ns = clocks.now_ns
    assert abs(ros_ns(base, before_ns / 1e9) - (before_ns + OFFSET_NS)) <= 2000
    clocks.now_ns += 2 * AHEAD_NS
    after_ns = before_ns + AHEAD_NS + 100_000
    assert abs(ros_ns(base, after_ns / 1e9) - (after_ns + OFFSET_NS + 3_000_000_000)) <= 2000


def test_nothing_is_converted_until_the_simulated_clock_runs() -> None:
    clocks, log, simulated_ns = Clocks([]), Mock(), 0
    base = TimeBase(lambda: simulated_ns, log, clocks.monotonic_ns)
    assert base.to_ros_ns(4.5) is None
    base.measure()
    assert not base.runs
    assert log.mock_calls == [call.warning(WAITING_FOR_CLOCK)]
    simulated_ns = 7_000_000_000
    assert abs(ros_ns(base, clocks.now_ns / 1e9 - 0.25) - 6_750_000_000) <= 10_000
    assert base.runs
    assert log.mock_calls[1:] == [call.info("/clock runs: motion is published from now on")]


def test_a_time_before_the_simulation_began_is_unknown() -> None:
    clocks, simulated_ns = Clocks([]), 1_000_000
    base = TimeBase(lambda: simulated_ns, Mock(), clocks.monotonic_ns)
    assert base.runs
    assert base.to_ros_ns(clocks.now_ns / 1e9 - 0.25) is None


def test_a_clock_that_is_switched_to_a_simulation_is_waited_for() -> None:
    clocks, log = Clocks([]), Mock()
    now_ns = clocks.ros_ns
    base = TimeBase(lambda: now_ns(), log, clocks.monotonic_ns)

    def simulated_ns() -> int:
        return 0

    now_ns = simulated_ns
    assert base.to_ros_ns(clocks.now_ns / 1e9) is None
    assert not base.runs
    assert log.mock_calls == [call.warning(WAITING_FOR_CLOCK)]


def simulated(speed: float, step_ns: int) -> tuple[list[int], TimeBase]:
    """The monotonic clock's time, to be set, and a base on a /clock of this speed and steps."""
    now_ns = [10**12]

    def ros_ns() -> int:
        return 5 * 10**9 + int((now_ns[0] - 10**12) * speed) // step_ns * step_ns

    return now_ns, TimeBase(ros_ns, Mock(), lambda: now_ns[0], is_simulated=lambda: True)


@pytest.mark.parametrize("speed", [0.5, 2.0, 10.0])
def test_the_speed_of_a_simulated_clock_is_measured(speed: float) -> None:
    now_ns, base = simulated(speed, 1_000_000)
    for _ in range(300):
        now_ns[0] += 20_000_000
        stamp = base.to_ros_ns((now_ns[0] - 4_000_000) / 1e9)
    assert base.rate == pytest.approx(speed, rel=0.01)
    assert stamp is not None
    true_ns = 5 * 10**9 + (now_ns[0] - 4_000_000 - 10**12) * speed
    assert stamp == pytest.approx(true_ns, abs=2_000_000)


def test_between_two_steps_of_a_simulated_clock_one_sample_has_a_time() -> None:
    now_ns, base = simulated(2.0, 200_000_000)
    stamps = []
    for _ in range(500):
        now_ns[0] += 10_000_000
        stamps.append(base.to_ros_ns((now_ns[0] - 1_000_000) / 1e9))
    found = [stamp for stamp in stamps if stamp is not None]
    assert len(found) in (50, 51)
    assert all(b > a for a, b in pairwise(found))


def test_one_stream_of_samples_takes_no_time_from_another() -> None:
    now_ns, base = simulated(2.0, 200_000_000)
    found = {"wheels": 0, "imu": 0}
    for _ in range(500):
        now_ns[0] += 10_000_000
        for stream in found:
            found[stream] += base.to_ros_ns((now_ns[0] - 1_000_000) / 1e9, stream) is not None
    assert min(found.values()) >= 50


def test_a_recording_that_restarts_is_followed() -> None:
    now_ns, start_ns = [10**12], [10**10]
    base = TimeBase(
        lambda: now_ns[0] - 10**12 + start_ns[0], Mock(), lambda: now_ns[0], lambda: True
    )
    for _ in range(100):
        now_ns[0] += 20_000_000
        base.to_ros_ns(now_ns[0] / 1e9)
    start_ns[0] = -(10**9)  # below 2 s, from 12
    now_ns[0] += 20_000_000
    stamp = base.to_ros_ns(now_ns[0] / 1e9)
    assert stamp is not None
    assert 0 < stamp < 2 * 10**9
    assert base.rate > 0


def test_an_offset_stays_while_another_is_as_good() -> None:
    clocks, noted = Clocks([]), list[Sequence[Offset]]()
    base = TimeBase(clocks.ros_ns, Mock(), clocks.monotonic_ns, note_offsets=noted.append)
    first = ros_ns(base, 4.5)
    clocks.offset_ns += 10_000
    base.measure()
    assert ros_ns(base, 4.75) == first + 250_000_000
    clocks.offset_ns += 50_000
    base.measure()
    assert len(noted) == 2
    before, after = noted[-1]
    assert [before] == list(noted[0])
    assert after.offset_ns - before.offset_ns == 60_000
    assert after.from_ns > clocks.now_ns


def test_time_never_runs_backward_in_a_stream(base: TimeBase) -> None:
    first = ros_ns(base, 4.5)
    for stamp_s in (4.5, 4.499, 3.0):  # as the estimate of the link's clock gets better
        assert base.to_ros_ns(stamp_s) is None
    assert base.to_ros_ns(4.499, "imu") == first - 1_000_000  # each stream by itself
    assert ros_ns(base, 4.501) == first + 1_000_000


def test_a_clock_that_was_set_back_starts_again(clocks: Clocks, base: TimeBase) -> None:
    first = ros_ns(base, 4.5)
    clocks.offset_ns -= 3_600_000_000_000
    assert ros_ns(base, 4.75) < first
    assert base.to_ros_ns(4.75) is None


def test_samples_of_a_recording_keep_the_stamps_of_their_day() -> None:
    """By the offsets of that day, each for the stamps from one on, however late that is."""
    clocks = Clocks([])
    of_the_day = [Offset(0, 17_000_000_000)]
    base = TimeBase(clocks.ros_ns, Mock(), clocks.monotonic_ns, recorded_offsets=lambda: of_the_day)
    assert ros_ns(base, 4.5) == 21_500_000_000
    of_the_day.append(Offset(5_000_000_000, 18_000_000_000))
    assert ros_ns(base, 4.9) == 21_900_000_000
    assert ros_ns(base, 5.0) == 23_000_000_000
