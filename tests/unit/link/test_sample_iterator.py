"""`for sample in robot.samples():`."""

from __future__ import annotations

import threading
import time
from collections import deque
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import Simulator, errors
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.clock import ClockEstimator, Exchange
from wheelwire.link.sample_iterator import QUEUE_US, Measured, SampleIterator
from wheelwire.link.state_stream import Measurement
from wheelwire.link.transports import SerialTransport
from wheelwire.samples import WheelSample
from wheelwire_protocol.types import WheelState


def test_each_sample_comes_once_and_in_order() -> None:
    with MockDriver(realtime=False) as robot:
        times = [sample.t_us for sample in islice(robot.samples(), 50)]
    assert {b - a for a, b in pairwise(times)} == {10_000}  # the default rate, 100 Hz


def test_a_fast_stream_loses_none_though_several_come_at_once() -> None:
    with Simulator() as simulator, SerialDriver(simulator.port, stream_rate_hz=1000) as robot:
        times = [sample.t_us for sample in islice(robot.samples(), 500)]
        assert robot.statistics.frames_lost == 0
    assert {b - a for a, b in pairwise(times)} == {1000}


def test_iterators_and_read_take_nothing_from_each_other() -> None:
    with MockDriver(realtime=False) as robot:
        first, second = robot.samples(), robot.samples()
        robot.advance(0.1)
        assert robot.read() == list(islice(first, 10))[-1]
        assert len(list(islice(second, 10))) == 10


def test_whoever_is_slow_misses_the_oldest_and_can_see_how_many() -> None:
    with MockDriver(realtime=False) as robot:
        samples = robot.samples()
        robot.advance(3.0)
        oldest = next(samples)
        newest = robot.read()
        assert samples.dropped == pytest.approx(200, abs=2)
        assert newest.stamp - oldest.stamp == pytest.approx(1.0, abs=0.02)


def test_closing_the_driver_ends_it_after_what_has_come() -> None:
    robot = MockDriver(realtime=False)
    samples = robot.samples()
    robot.advance(0.05)
    robot.close()
    assert len(list(samples)) >= 5
    assert list(robot.samples()) == []


def test_closing_ends_a_wait_in_another_thread(tmp_path: Path) -> None:
    with PtyDevice(tmp_path / "port") as device:
        device.device.lost.add(WheelState)
        robot = SerialDriver(str(device.path))
        samples = robot.samples()
        thread = threading.Thread(target=list, args=(samples,))
        thread.start()
        robot.close()
        thread.join(10)
        assert not thread.is_alive()


def test_it_waits_across_a_reconnection(tmp_path: Path) -> None:
    with PtyDevice(tmp_path / "port") as device, SerialDriver(str(device.path)) as robot:
        samples = robot.samples()
        next(samples)
        device.unplug()
        wait_until(lambda: not robot.is_open)
        plugged_s = time.monotonic()
        device.plug()
        assert next(sample for sample in samples if sample.stamp > plugged_s)


def test_a_link_that_ends_otherwise_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: SerialTransport) -> bytes:
        raise ZeroDivisionError

    with PtyDevice(tmp_path / "port") as device, SerialDriver(str(device.path)) as robot:
        samples = robot.samples()
        monkeypatch.setattr(SerialTransport, "read", fail)
        with pytest.raises(errors.LinkClosed, match="ZeroDivisionError"):
            list(samples)


def test_a_forgotten_iterator_costs_nothing() -> None:
    with MockDriver(realtime=False) as robot:
        samples = robot.samples()
        next(samples)
        assert robot._latest_sample.is_iterated
        del samples
        robot.advance(0.05)
        assert not robot._latest_sample.is_iterated


def measured(arrived_us: int) -> Measurement:
    clock = ClockEstimator()
    clock.add(Exchange(0, 0, 0, 0))
    state = WheelState(**{**dict.fromkeys(WheelState._fields, 0), "t_us": arrived_us})
    return Measurement(state, arrived_us, clock.conversion, arrived_us)


def test_a_sample_that_is_taken_while_it_is_dropped_costs_no_other() -> None:
    taken: list[int] = []

    class Racing(deque[list[Measured[WheelSample]]]):
        """Whoever iterates takes one each time the other thread has looked at the oldest."""

        def __getitem__(self, index: Any) -> Any:
            oldest = super().__getitem__(index)
            sample = iterator.poll()
            if sample is not None:
                taken.append(sample.t_us)
            return oldest

    iterator: SampleIterator[WheelSample] = SampleIterator(lambda _: None)
    iterator._queue = Racing()
    late_us = 2 * QUEUE_US
    for arrived_us in (0, late_us, late_us + 1):
        iterator._queue.append([measured(arrived_us)])
    iterator.put(measured(late_us + 2))
    while (sample := iterator.poll()) is not None:
        taken.append(sample.t_us)
    assert [t_us for t_us in taken if t_us >= late_us] == [late_us, late_us + 1, late_us + 2]
    assert len(taken) + iterator.dropped == 4
