"""Which message a stop is ascribed to."""

from __future__ import annotations

import pytest

from wheelwire.log.why.history import SUPPLY_PERIOD_US, SUPPLY_POINTS, History, Supply
from wheelwire_protocol.types import Stop

SPAN_US = 500_000
COPY, FIRST, SECOND = (Stop(7, number, 40, 0) for number in range(3))


def history(*sent: tuple[int, Stop]) -> History:
    found = History()
    found.sent.extend(sent)
    return found


@pytest.mark.parametrize("early_us", [-50, 0, 50, 500])
def test_two_stops_within_a_millisecond_have_a_message_each(early_us: int) -> None:
    """`early_us`: by how much the stops' times, on the device's clock, are too early."""
    found = history((0, COPY), (300, FIRST), (1400, COPY), (1600, SECOND))
    assert 300 in found.stops_by(Stop, 20 - early_us, SPAN_US)
    assert found.stops_by(Stop, 1420 - early_us, SPAN_US) == [1600]


def test_a_repeat_and_a_late_number_explain_no_later_stop() -> None:
    # The first one stopped nothing, the second was acknowledged only after its repeat.
    found = history((0, COPY), (200, FIRST), (200_000, COPY), (200_400, SECOND), (225_400, SECOND))
    assert found.stops_by(Stop, 200_020, SPAN_US)[-1] == 225_400
    assert found.stops_by(Stop, 300_000, SPAN_US) == []


def test_a_stop_is_ascribed_alike_however_often_it_is_asked_for() -> None:
    found = history((0, COPY), (300, FIRST))
    assert found.stops_by(Stop, 20, SPAN_US) == found.stops_by(Stop, 20, SPAN_US) == [0, 300]
    assert found.stops_by(Stop, 40_000, SPAN_US) == []


def test_a_stop_keeps_its_message_although_a_strangers_came_just_before() -> None:
    found = history((10_000, COPY), (10_400, FIRST))
    assert found.stops_by(Stop, 1000, SPAN_US)  # not known better: it may have been sent late
    assert found.stops_by(Stop, 10_020, SPAN_US) == [10_400]
    assert found.stops_by(Stop, 60_000, SPAN_US) == []


def test_the_supply_has_the_newest_half_hour_in_order() -> None:
    supply = Supply()
    assert supply.points() == []
    added = [
        (number * SUPPLY_PERIOD_US, 12.0 - number / 1000, float(number % 2))
        for number in range(2 * SUPPLY_POINTS + 700)
    ]
    for number, (at_us, volts, driven) in enumerate(added, 1):
        supply.add(int(at_us), volts, driven=bool(driven))
        supply.add(int(at_us) + SUPPLY_PERIOD_US - 1, 0.0, driven=False)  # too soon
        if number in (1, 2, SUPPLY_POINTS, SUPPLY_POINTS + 1, 2 * SUPPLY_POINTS, len(added)):
            assert supply.points() == added[:number][-SUPPLY_POINTS:]
