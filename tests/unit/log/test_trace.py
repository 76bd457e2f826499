"""What a recording shows over time, and the lines that a picture makes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from support.recordings import traffic_of
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.link.traffic import Kind, Record
from wheelwire.log.plot import GAP_S, POINTS, Asked, Trace, draw, line, steps
from wheelwire_protocol.codes import Fault, SupervisorState


def states(trace: Trace) -> list[SupervisorState | None]:
    return [band.state for band in trace.bands]


def test_a_drive_that_expires() -> None:
    def day(robot: VirtualMockDriver) -> None:
        robot.set_velocity(0.2, 0.0, ttl=0.3)
        robot.advance(0.1)
        robot.set_velocity(0.3, 0.0, ttl=0.3)
        robot.advance(1.0)

    trace = Trace.of(traffic_of(day))
    assert list(trace.asked_speed.left) == list(trace.asked_speed.right) == [0.2, 0.3]
    first, second = zip(trace.asked_speed.begins_s, trace.asked_speed.ends_s, strict=True)
    assert first[1] == second[0] == pytest.approx(0.1, abs=0.01)
    assert second[1] - second[0] == pytest.approx(0.3, abs=0.01)
    assert states(trace)[:2] == [SupervisorState.DRIVING, SupervisorState.TIMED_OUT]
    driving = next(band for band in trace.bands if band.state is SupervisorState.DRIVING)
    assert driving.end_s - driving.begin_s == pytest.approx(0.4, abs=0.03)
    assert max(trace.left_mps) > 0.2
    assert max(trace.right_duty) > 0.1
    assert trace.end_s == pytest.approx(1.1, abs=0.01)
    for earlier, later in zip(trace.bands, trace.bands[1:], strict=False):
        assert earlier.end_s == later.begin_s


def test_a_stop_ends_what_was_asked_for() -> None:
    def day(robot: VirtualMockDriver) -> None:
        robot.set_duty(0.3, -0.3, ttl=1.0)
        robot.advance(0.2)
        robot.stop()
        robot.advance(0.5)

    trace = Trace.of(traffic_of(day))
    assert (list(trace.asked_duty.left), list(trace.asked_duty.right)) == ([0.3], [-0.3])
    assert trace.asked_duty.ends_s[0] == pytest.approx(0.2, abs=0.01)
    assert not trace.asked_speed.left


def test_a_fault_is_marked_once() -> None:
    def day(robot: VirtualMockDriver) -> None:
        robot.simulator.set("left.blocked", 1)
        for _ in range(60):
            robot.set_velocity(0.3, 0.0, ttl=0.3)
            robot.advance(0.05)
            if robot.read().faults:
                break
        robot.advance(0.5)

    trace = Trace.of(traffic_of(day))
    (mark,) = trace.marks
    assert mark.faults is Fault.LEFT_NOT_COUNTING
    fault = next(band for band in trace.bands if band.state is SupervisorState.FAULT)
    assert fault.begin_s == mark.time_s


def test_out_of_reach_is_a_band() -> None:
    def day(robot: VirtualMockDriver) -> None:
        robot.advance(0.2)
        robot.unplug()
        robot.advance(0.2)

    trace = Trace.of(traffic_of(day))
    assert states(trace)[-2:] == [SupervisorState.IDLE, None]


def test_few_samples_are_drawn_as_they_are() -> None:
    times = np.arange(10) / 10
    values = np.arange(10.0) ** 2
    x, y = line(times, values)
    assert sorted(set(zip(x, y, strict=True))) == list(zip(times, values, strict=True))


def test_of_many_samples_none_that_stands_out_is_missing() -> None:
    times = np.arange(40 * POINTS) / 1000
    values = np.zeros(len(times))
    values[[12_345, 100_000]] = 5.0, -7.0
    x, y = line(times, values)
    assert len(x) <= 4 * POINTS
    assert (y.max(), y.min()) == (5.0, -7.0)
    assert x[y.argmax()] == pytest.approx(12.345, abs=0.05)
    assert (x[0], x[-1]) == (times[0], times[-1])


@pytest.mark.parametrize("count", [10, 20 * POINTS])
def test_no_line_leads_across_a_gap(count: int) -> None:
    times = np.concatenate((np.arange(count), np.arange(count) + 5 * count)) / count
    x, y = line(times * 10 * GAP_S, np.ones(2 * count))
    assert np.isnan(y).any()
    gaps = np.flatnonzero(np.diff(x) > 5 * GAP_S)
    assert gaps.size == 1
    assert np.isnan(y[gaps[0]]) or np.isnan(y[gaps[0] + 1])


def asked(*setpoints: tuple[float, float, float]) -> tuple[Asked, list[float]]:
    found = Asked()
    for begin_s, end_s, value in setpoints:
        found.begins_s.append(begin_s)
        found.ends_s.append(end_s)
        found.left.append(value)
    return found, list(found.left)


def test_equal_setpoints_are_one_step() -> None:
    x, y = steps(*asked((0, 1, 0.5), (1, 2, 0.5), (2, 3, 0.25), (5, 6, 0.25)))
    assert list(x) == [0, 2, 2, 2, 3, 3, 5, 6, 6]
    np.testing.assert_array_equal(y, [0.5, 0.5, 0.5, 0.25, 0.25, np.nan, 0.25, 0.25, np.nan])
    assert [len(one) for one in steps(*asked())] == [0, 0]


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_picture_of_nothing(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"empty{suffix}"
    draw(Trace(), "nothing", path)
    draw(Trace.of([Record(0, Kind.NOTE, 5, b"{}")]), "next to nothing", path)
    assert path.stat().st_size > 1000
