from __future__ import annotations

from collections.abc import Iterator

from wheelwire_ros.time_base import TimeBase

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


def test_a_monotonic_time_becomes_ros_time() -> None:
    clocks = Clocks([])
    base = TimeBase(clocks.ros_ns, clocks.monotonic_ns)
    assert abs(base.to_ros_ns(4.5) - (4_500_000_000 + OFFSET_NS)) <= 1000
    assert base.error_s == 1e-6


def test_an_interrupted_reading_is_not_the_one_that_counts() -> None:
    clocks = Clocks([40_000_000, 30_000_000, 0, 50_000_000, 20_000_000])
    base = TimeBase(clocks.ros_ns, clocks.monotonic_ns)
    assert abs(base.to_ros_ns(1.0) - (1_000_000_000 + OFFSET_NS)) <= 1000


def test_no_stamp_is_in_the_future_though_the_ros_clock_was_set_back() -> None:
    clocks = Clocks([])
    base = TimeBase(clocks.ros_ns, clocks.monotonic_ns)
    clocks.offset_ns -= 3_000_000_000
    stamp_ns = clocks.now_ns - 1_000_000
    assert abs(base.to_ros_ns(stamp_ns / 1e9) - (stamp_ns + clocks.offset_ns)) <= 2000
    assert base.to_ros_ns(clocks.now_ns / 1e9 + 60) <= clocks.ros_ns()


def test_a_step_of_the_ros_clock_is_followed() -> None:
    clocks = Clocks([])
    base = TimeBase(clocks.ros_ns, clocks.monotonic_ns)
    clocks.offset_ns += 3_000_000_000
    base.measure()
    assert abs(base.to_ros_ns(1.0) - (4_000_000_000 + OFFSET_NS)) <= 1000
