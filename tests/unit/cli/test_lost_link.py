"""A lost link: `monitor` goes on when it is back, the others say what to do."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, cast

import pytest

from wheelwire import LinkClosed, LinkLost, RequestTimeout, WheelSample
from wheelwire.cli.interruptions import SILENT_S, SLICE_S, ended_by_a_loss, watch

SAMPLE = cast("WheelSample", object())
LOST = LinkLost("the port is gone (unplugged?); it is opened again when it is back")
SILENT = RequestTimeout("no sample")


class Robot:
    """Gives a sample, or an error, at each read; an error at once or after the whole time-out."""

    def __init__(self, results: Iterator[object], *, at_once: bool = True) -> None:
        self.results = results
        self.at_once = at_once
        self.now = 100.0
        self.reads = 0

    def read(self, timeout: float) -> WheelSample:
        self.reads += 1
        result = next(self.results)
        if isinstance(result, Exception):
            self.now += 0.0 if self.at_once else timeout
            raise result
        self.now += 0.01
        return cast("WheelSample", result)

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def watched(self, seconds: float) -> list[Any]:
        return list(watch(cast("Any", self), self.now + seconds, self.clock, self.sleep))


def news(found: list[Any]) -> list[str]:
    return [item for item in found if isinstance(item, str)]


@pytest.mark.parametrize("at_once", [True, False])
def test_it_goes_on_when_the_link_is_back(*, at_once: bool) -> None:
    robot = Robot(itertools.chain([SAMPLE] * 3, [LOST] * 20, itertools.repeat(SAMPLE)))
    robot.at_once = at_once
    found = robot.watched(10)
    assert found[:3] == [SAMPLE] * 3
    assert found[3:6] == [str(LOST), "the link is back", SAMPLE]
    assert len(news(found)) == 2


def test_it_goes_on_when_a_silent_device_speaks_again() -> None:
    silent = round(2 * SILENT_S / SLICE_S)
    results = itertools.chain([SAMPLE], [SILENT] * silent, itertools.repeat(SAMPLE))
    found = Robot(results, at_once=False).watched(5)
    lost, back = news(found)
    assert "sends nothing" in lost
    assert back == "the link is back"
    assert found[-1] is SAMPLE


def test_a_short_silence_is_not_reported() -> None:
    results = itertools.chain([SAMPLE], [SILENT], itertools.repeat(SAMPLE))
    assert news(Robot(results, at_once=False).watched(5)) == []


@pytest.mark.parametrize("at_once", [True, False])
def test_its_time_ends_meanwhile(*, at_once: bool) -> None:
    robot = Robot(itertools.repeat(LOST), at_once=at_once)
    began = robot.now
    assert robot.watched(3.0) == [str(LOST)]
    assert robot.now - began == pytest.approx(3.0, abs=0.01)
    # A loss that is reported at once is not asked for in a tight loop.
    assert robot.reads <= 3.0 / SLICE_S + 1


def test_a_driver_that_was_closed_ends_it() -> None:
    with pytest.raises(LinkClosed):
        Robot(iter([LinkClosed("closed")])).watched(3.0)


def test_a_loss_says_what_to_do_and_not_that_it_is_waited_for() -> None:
    with pytest.raises(LinkLost) as error, ended_by_a_loss():
        raise LOST
    assert str(error.value) == (
        "the port is gone (unplugged?); the robot stops by itself when its last setpoint expires: "
        "check cable and power, then run the command again"
    )
