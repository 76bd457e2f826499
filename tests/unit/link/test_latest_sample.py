import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest

from support.host_samples import measurement
from support.waiting import wait_until
from wheelwire.errors import LinkLost, RequestTimeout
from wheelwire.link.clock import host_clock_us
from wheelwire.link.sample_stream import ATTENTION_US, FRESH_US, LatestSample


@pytest.fixture
def latest_sample() -> LatestSample:
    return LatestSample()


def test_the_newest_sample_wins_and_is_handed_out_once(latest_sample: LatestSample) -> None:
    latest_sample.put(measurement(t_us=1))
    latest_sample.put(measurement(t_us=2))
    assert latest_sample.take(0).t_us == 2
    with pytest.raises(RequestTimeout):
        latest_sample.take(0)


def test_of_several_that_wait_each_gets_the_sample_once(latest_sample: LatestSample) -> None:
    def read() -> list[int]:
        found = [latest_sample.take(10).t_us]
        with suppress(RequestTimeout):
            found.append(latest_sample.take(0).t_us)
        return found

    with ThreadPoolExecutor(3) as readers:
        results = [readers.submit(read) for _ in range(3)]
        wait_until(lambda: len(latest_sample.changed.waiting) == 3)
        latest_sample.put(measurement(t_us=5))
        latest_sample.notify_all()
        assert [one.result() for one in results] == [[5]] * 3


def test_after_a_failure_there_is_only_the_error(latest_sample: LatestSample) -> None:
    latest_sample.put(measurement(t_us=1))
    latest_sample.fail(LinkLost("over"))
    with pytest.raises(LinkLost, match="over"):
        latest_sample.take(10)
    with pytest.raises(LinkLost, match="over"):
        latest_sample.ticks(10)


def test_a_failure_ends_the_wait(latest_sample: LatestSample) -> None:
    threading.Timer(0.02, latest_sample.fail, [LinkLost("over")]).start()
    with pytest.raises(LinkLost, match="over"):
        latest_sample.take(10)


def test_ticks_from_before_an_interruption_are_not_current(latest_sample: LatestSample) -> None:
    latest_sample.put(measurement(left_ticks=7))
    latest_sample.interrupt()
    with pytest.raises(RequestTimeout):
        latest_sample.ticks(0)
    latest_sample.put(measurement(left_ticks=9))
    assert latest_sample.ticks(0) == (9, 0)


def test_it_is_read_for_some_time_after_each_question(latest_sample: LatestSample) -> None:
    assert not latest_sample.is_read(host_clock_us())
    with pytest.raises(RequestTimeout):
        latest_sample.take(0)
    asked_us = host_clock_us()
    assert latest_sample.is_read(asked_us)
    assert not latest_sample.is_read(asked_us + ATTENTION_US)
    assert not latest_sample.changed.waiting


def test_ticks_go_on_across_a_reset_of_the_device(latest_sample: LatestSample) -> None:
    for boot_id, left, right in ((1, 5, 7), (1, 8, 9), (2, 0, 0), (2, 2, 3)):
        latest_sample.put(measurement(boot_id=boot_id, left_ticks=left, right_ticks=right))
    assert latest_sample.ticks(0) == (10, 12)


def test_a_sample_that_nobody_has_read_in_time_is_not_handed_out(
    latest_sample: LatestSample,
) -> None:
    latest_sample.put(measurement(t_us=1))
    later_us = host_clock_us() + FRESH_US + 1
    latest_sample.now_us = lambda: later_us
    assert latest_sample.poll() is None
    latest_sample.put(measurement(t_us=2))
    latest_sample.now_us = lambda: later_us + FRESH_US
    with pytest.raises(RequestTimeout):
        latest_sample.take(0)


def test_a_sample_of_a_slow_stream_lasts_for_two_periods(latest_sample: LatestSample) -> None:
    for t_us in (0, 500_000, 1_000_000):
        latest_sample.put(measurement(t_us=t_us))
    now_us = host_clock_us()
    latest_sample.now_us = lambda: now_us + 900_000
    assert latest_sample.take(0).t_us == 1_000_000
    latest_sample.put(measurement(t_us=1_500_000))
    latest_sample.now_us = lambda: now_us + 2_000_000
    with pytest.raises(RequestTimeout):
        latest_sample.take(0)


def test_a_sample_from_before_an_interruption_is_not_handed_out(
    latest_sample: LatestSample,
) -> None:
    latest_sample.put(measurement(t_us=1))
    latest_sample.interrupt()
    assert latest_sample.poll() is None


def test_the_latest_is_there_read_or_not_with_its_age(latest_sample: LatestSample) -> None:
    assert latest_sample.latest is None
    latest_sample.put(measurement(t_us=2_000_000))
    latest_sample.now_us = lambda: 2_300_000
    latest_sample.interrupt()
    for _ in range(2):
        latest = latest_sample.latest
        assert latest is not None
        assert latest.sample.t_us == 2_000_000
        assert latest.age_s == pytest.approx(0.3)
