"""A recording as a link: the day's samples again, in time or step by step."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from support.virtual_line import VirtualLine
from wheelwire.errors import InvalidCommand, LinkClosed, LinkLost, RecordingError
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.traffic import Happening, Kind, Record, TrafficReader
from wheelwire.log.replay import ReplayLink
from wheelwire.samples import Setpoint
from wheelwire.simulation.bad_line import Impairment
from wheelwire_protocol.codes import Group, StopMode
from wheelwire_protocol.types import (
    ClearEstop,
    GroupGet,
    LinkCountersGet,
    ParameterGet,
    ParameterSet,
    ParameterValue,
)

BAD = Impairment(delay_us=300, jitter_us=4000, loss=0.05, flip=0.02, repeat=0.02, reorder=0.02)
WHEEL_RADIUS = 1
GAIN = 10
ASKED_GAIN = 0.75
ARMED_AFTER_S = 1.1
"""The day begins with the pause that arms the robot."""


@dataclass
class Day:
    line: VirtualLine
    records: list[Record] = field(default_factory=list)
    setpoints: list[tuple[float, float]] = field(default_factory=list)


def recorded(seconds: int = 3, impairment: Impairment = BAD) -> Day:
    """A drive with a lost cable in its middle."""
    line = VirtualLine(5, to_device=impairment, to_host=impairment, watched=(1, 2, 3, 6, 16))
    reader = TrafficReader(limit=1_000_000)
    line.session.listen(reader, line.now_us)
    line.open()
    day = Day(line)
    for second in range(seconds):
        for step in range(20):
            day.setpoints.append((0.1 * second, 0.01 * step))
            line.drive(*day.setpoints[-1])
            line.run(0.05)
        line.request(ParameterSet(0, 0, GAIN, ASKED_GAIN))
        if second == seconds // 2:
            line.session.disconnect(LinkLost("unplugged"))
            line.session.connect(line.now_us)
            line.wait_open()
    day.records = reader.take()
    return day


@pytest.fixture(scope="module")
def day() -> Day:
    return recorded()


def replay(day: Day, speed: float = 0.0) -> tuple[ReplayLink, LatestSample]:
    latest = LatestSample()
    link = ReplayLink(latest, "day.mcap", lambda: day.records, speed)
    link.open()
    return link, latest


def play_all(link: ReplayLink) -> None:
    while not link.has_ended:
        link.advance(0.01)


def test_step_by_step_the_samples_are_those_of_the_day(day: Day) -> None:
    _, latest = replay(day)
    iterator = latest.iterate()
    samples = list(iterator)
    assert len(samples) > 100
    assert samples == day.line.samples[-len(samples) :]
    assert len(day.line.samples) - len(samples) <= 1  # one came with the end of the opening


def test_the_counters_at_the_end_are_those_of_the_day(day: Day) -> None:
    link, _ = replay(day)
    play_all(link)
    ours = link.statistics
    theirs = day.line.session.statistics(day.records[-1].host_us)
    assert ours.frames_lost == theirs.frames_lost > 0
    assert ours.frames_received == theirs.frames_received
    assert ours.round_trip_p99_us == theirs.round_trip_p99_us
    assert ours.clock_error_us == theirs.clock_error_us
    assert ours.sessions == 2
    assert ours.reconnects == 1


def test_a_day_on_which_nobody_asked_for_the_sensors_says_so(day: Day) -> None:
    """Its session does not ask by itself whether its firmware has any."""
    link, _ = replay(day)
    with pytest.raises(InvalidCommand, match="no program had requested the sensors"):
        link.request(GroupGet(0, 0, Group.SENSOR))


def test_its_end_ends_iterators_and_fails_calls(day: Day) -> None:
    link, latest = replay(day, speed=1000.0)
    iterator = latest.iterate()
    for _ in iterator:
        pass
    assert link.has_ended
    with pytest.raises(LinkClosed, match="the recording has ended"):
        latest.take(1.0)
    with pytest.raises(LinkClosed, match="the recording has ended"):
        link.check()
    link.close()
    link.close()


def test_it_can_be_closed_in_the_middle(day: Day) -> None:
    link, latest = replay(day, speed=0.01)
    iterator = latest.iterate()
    link.close()
    assert list(iterator) == []
    with pytest.raises(LinkClosed, match="closed"):
        link.check()


def test_a_lost_cable_is_reported_as_on_the_day(day: Day) -> None:
    link, _ = replay(day)
    happened: list[Happening] = []
    link.listen(lambda news: happened.append(news[0]), Happening.LOST)
    play_all(link)
    assert happened[:2] == [Happening.LOST, Happening.OPENED]


def test_setpoints_are_compared_with_those_of_the_day(day: Day) -> None:
    link, _ = replay(day)
    link.advance(ARMED_AFTER_S + 0.2)
    link.drive_velocity(*day.setpoints[0], expiry_us=0)
    link.drive_velocity(*day.setpoints[1], expiry_us=0)
    assert (link.comparison.compared, link.comparison.different) == (2, 0)
    link.drive_velocity(0.3, 0.3, expiry_us=0)
    link.drive_duty(*day.setpoints[3], expiry_us=0)
    seen = link.comparison
    assert (seen.compared, seen.different) == (4, 2)
    assert seen.first_difference == (
        2,
        Setpoint(*day.setpoints[2], duty=False),
        Setpoint(0.3, 0.3, duty=False),
    )


def test_setpoints_that_come_first_wait_for_the_recorded_ones(day: Day) -> None:
    link, _ = replay(day)
    for setpoint in day.setpoints[:10]:
        link.drive_velocity(*setpoint, expiry_us=0)
    assert link.comparison.compared < 5
    link.advance(ARMED_AFTER_S + 1.0)
    assert (link.comparison.compared, link.comparison.different) == (10, 0)


def test_it_answers_what_is_known(day: Day) -> None:
    link, _ = replay(day)
    answer = link.request(ParameterGet(0, 0, WHEEL_RADIUS))
    assert isinstance(answer, ParameterValue)
    assert answer.value == link.watched_values[WHEEL_RADIUS]
    # Setting an active value changes nothing.
    assert link.request(ParameterSet(0, 0, WHEEL_RADIUS, answer.value)).value == answer.value  # type: ignore[union-attr]


def test_it_answers_what_was_asked_a_moment_later(day: Day) -> None:
    link, _ = replay(day)
    answer = link.request(ParameterGet(0, 0, GAIN))
    assert isinstance(answer, ParameterValue)
    assert answer.value == ASKED_GAIN


def test_it_answers_nothing_else(day: Day) -> None:
    link, _ = replay(day)
    for message in (
        ParameterSet(0, 0, WHEEL_RADIUS, 0.1),
        ParameterGet(0, 0, 11),
        LinkCountersGet(0, 0),
        ClearEstop(0, 0),
    ):
        with pytest.raises(InvalidCommand, match="is a recording"):
            link.request(message)
    answers: list[object] = []
    link.post(ParameterSet(0, 0, WHEEL_RADIUS, 0.1), answers.append)
    assert isinstance(answers[0], InvalidCommand)


def test_stops_are_taken(day: Day) -> None:
    link, _ = replay(day)
    link.stop()
    link.stop(StopMode.COAST)
    link.estop()
    link.close()
    with pytest.raises(LinkClosed):
        link.stop()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_recording_without_a_session_is_refused(day: Day, count: int) -> None:
    short = Day(day.line, day.records[:count])
    with pytest.raises(RecordingError, match=r"day\.mcap: "):
        replay(short)


def test_a_damaged_record_ends_the_replay(day: Day) -> None:
    damaged = list(day.records)
    place = next(i for i, r in enumerate(damaged) if r.kind is Kind.VELOCITY)
    damaged[place] = damaged[place]._replace(data=b"")
    link, latest = replay(Day(day.line, damaged), speed=100.0)
    with pytest.raises(RecordingError, match="damaged"):
        list(latest.iterate())
    link.close()


def test_a_recording_is_not_recorded(day: Day) -> None:
    link, _ = replay(day)
    with pytest.raises(InvalidCommand, match="copy the file"):
        link.listen_to_traffic(TrafficReader())
