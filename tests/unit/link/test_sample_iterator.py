"""`for sample in robot.samples():`."""

from __future__ import annotations

import threading
import time
from collections import deque
from functools import partial
from itertools import islice, pairwise
from typing import Any

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import Simulator
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.sample_stream import QUEUE_US, SampleIterator
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


def test_a_slow_reader_misses_the_oldest_samples_and_their_number_is_known() -> None:
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


def test_closing_ends_a_wait_in_another_thread(device: PtyDevice) -> None:
    device.device.lost.add(WheelState)
    robot = SerialDriver(str(device.path))
    samples = robot.samples()
    thread = threading.Thread(target=list, args=(samples,))
    thread.start()
    robot.close()
    thread.join(10)
    assert not thread.is_alive()


def test_it_waits_across_a_reconnection(device: PtyDevice, robot: SerialDriver) -> None:
    samples = robot.samples()
    next(samples)
    device.unplug()
    wait_until(lambda: not robot.is_open)
    plugged_s = time.monotonic()
    device.plug()
    assert next(sample for sample in samples if sample.stamp > plugged_s)


def test_a_forgotten_iterator_costs_nothing() -> None:
    with MockDriver(realtime=False) as robot:
        samples = robot.samples()
        next(samples)
        assert robot._latest_sample.is_iterated
        del samples
        robot.advance(0.05)
        assert not robot._latest_sample.is_iterated


def test_a_sample_that_is_taken_while_it_is_dropped_costs_no_other() -> None:
    taken: list[int] = []

    class Racing(deque[Any]):
        """The iterator takes one each time the other thread has looked at the oldest."""

        def __getitem__(self, index: Any) -> Any:
            oldest = super().__getitem__(index)
            arrived_us = iterator.poll()
            if arrived_us is not None:
                taken.append(arrived_us)
            return oldest

    iterator: SampleIterator[int] = SampleIterator(lambda _ready, _timeout_s: False)
    iterator._queue = Racing()
    late_us = 2 * QUEUE_US
    times_us = (0, late_us, late_us + 1, late_us + 2)
    iterator._queue.extend([(partial(int, at_us), at_us)] for at_us in times_us[:-1])
    iterator.put(partial(int, times_us[-1]), times_us[-1])
    taken += iter(iterator.poll, None)
    assert [at_us for at_us in taken if at_us >= late_us] == list(times_us[1:])
    assert len(taken) + iterator.dropped == 4
