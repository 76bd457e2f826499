"""A session done again from its tap is the same, whatever the line did."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import fields
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.core_device import UNHURRIED, CoreDevice
from support.virtual_line import VirtualLine
from wheelwire.errors import LinkLost, WheelwireError
from wheelwire.link.session import Phase, Session
from wheelwire.link.traffic import Kind, Record, TrafficReader
from wheelwire.log.rerun import Rerun
from wheelwire.samples import WheelSample
from wheelwire.simulation.bad_line import Impairment
from wheelwire.simulation.libfwsim import FwSim
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import GroupGet, ParameterGet, ParameterSet, SensorStream

BAD = Impairment(delay_us=300, jitter_us=4000, loss=0.05, flip=0.02, repeat=0.02, reorder=0.02)


def on_a_bad_line(seed: int) -> VirtualLine:
    device = CoreDevice(seed=seed + 1, **UNHURRIED)
    return VirtualLine(
        seed, to_device=BAD, to_host=BAD, device=device, stream_rate_hz=100, watched=(1, 2, 3)
    )


def listened(line: VirtualLine) -> TrafficReader:
    reader = TrafficReader(limit=1_000_000)
    line.session.listen(reader, line.now_us)
    return reader


def done_again(reader: TrafficReader) -> tuple[list[WheelSample], Session]:
    """The samples of what a reader has, and its session."""
    again = Rerun()
    measured = again.feed_all(reader.take())
    assert again.session is not None
    return [one.sample() for one in measured], again.session


def drive(line: VirtualLine, random: Random) -> None:
    line.drive(random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3))


def set_gain(line: VirtualLine, random: Random) -> None:
    gain = ParameterSet(0, 0, 10, random.uniform(0, 2))
    line.post(gain)


def give_up(line: VirtualLine, _: Random) -> None:
    def done(_: object) -> None:
        """Given up below."""

    for parameter in range(1, 4):
        line.session.request(ParameterGet(0, 0, parameter), done, line.now_us)
    line.session.withdraw(done)


def stop(line: VirtualLine, _: Random) -> None:
    line.post_stop()


def replug(line: VirtualLine, random: Random) -> None:
    if random.random() < 0.3:
        line.session.disconnect(LinkLost("unplugged"))
        line.session.connect(line.now_us)


def reset(line: VirtualLine, random: Random) -> None:
    if random.random() < 0.3:
        line.device.reset()


def a_day(line: VirtualLine, random: Random) -> None:
    """Drive, ask, stop, lose the cable, reset, in any order."""
    for _ in range(random.randrange(5, 30)):
        act = random.choice((drive, drive, drive, set_gain, give_up, stop, replug, reset))
        with suppress(WheelwireError):  # out of reach, or refused: still recorded
            act(line, random)
        line.run(random.uniform(0, 0.3))


def assert_same(again: Session, session: Session, now_us: int) -> None:
    """Everything that a program can see of a session."""
    assert again.phase is session.phase
    assert again.device == session.device
    assert again.reported.values == session.reported.values
    assert again.reported.watched_values == session.reported.watched_values
    assert again.count == session.count
    ours, theirs = again.statistics(now_us), session.statistics(now_us)
    for field in fields(theirs):
        assert repr(getattr(ours, field.name)) == repr(getattr(theirs, field.name)), field.name


@given(st.integers(0, 2**32))
def test_the_same_samples_stamps_and_counters(seed: int) -> None:
    random = Random(seed)
    line = on_a_bad_line(seed)
    reader = listened(line)
    line.open()
    a_day(line, random)
    samples, again = done_again(reader)
    assert samples == line.samples
    assert_same(again, line.session, line.now_us)


@pytest.mark.whole
@given(st.integers(0, 2**32))
def test_a_listener_that_comes_late_gets_the_same_from_there_on(seed: int) -> None:
    random = Random(seed)
    line = on_a_bad_line(seed)
    line.session.connect(line.now_us)
    line.run(random.uniform(0, 1))
    reader = listened(line)
    line.run_until(lambda: bool(line.session.traffic.readers))  # not while it is being prepared
    known = len(line.samples)
    line.wait_open()
    line.run(3)
    # The frame that was half there when it came is counted as lost there alone.
    samples, again = done_again(reader)
    assert len(samples) > 10
    assert samples == line.samples[-len(samples) :]
    # The step in which it joined may have brought a sample, too.
    assert len(line.samples) - known - len(samples) in (-1, 0, 1)
    assert again.phase is Phase.OPEN
    assert again.reported.watched_values == line.session.reported.watched_values


def test_a_listener_that_comes_late_knows_what_was_answered_since() -> None:
    line = VirtualLine(watched=(1, 2, 3))
    line.open()
    set_gain(line, Random(1))
    line.run(0.1)
    for seed in (2, 3):  # one is open, one waits
        set_gain(line, Random(seed))
    reader = listened(line)
    line.run(0.1)
    set_gain(line, Random(4))
    line.run(0.1)
    _, again = done_again(reader)
    assert again.reported.values == line.session.reported.values


def without_questions(data: bytes) -> bytes:
    """Whole frames without those that ask for groups, which is how a session asks for a board."""
    frames = [b"\0" + frame + b"\0" for frame in data.split(b"\0") if frame]
    return b"".join(
        frame for frame in frames if not any(isinstance(m, GroupGet) for m in Decoder().feed(frame))
    )


@pytest.mark.parametrize("after_ms", [0, 50, 90, 110, 150, 200, 400])
def test_whenever_a_listener_comes_it_knows_board_and_sensors(after_ms: int) -> None:
    """The line loses what the session itself asks for, until 0.1 s after it has opened."""
    now_us, since_open_ms = 1_000_000, 0
    session, reader = Session(lambda: 7, None, ()), TrafficReader(limit=1_000_000)
    with FwSim() as sim:
        session.connect(now_us)
        while since_open_ms < 2000:
            session.advance(now_us)
            sent = session.take_output()
            sim.write(sent if since_open_ms > 100 else without_questions(sent))
            sim.advance_us(1000)
            now_us += 1000
            session.receive(sim.read(), now_us)
            if session.phase is Phase.OPEN:
                if since_open_ms == after_ms:
                    session.listen(reader, now_us)
                if since_open_ms == 1000:
                    session.request(SensorStream(0, 0, 50), lambda _: None, now_us)
                since_open_ms += 1
    _, again = done_again(reader)
    assert session.reported.board is not None
    assert again.reported.board == session.reported.board
    assert again.sensors.rate_hz == 50
    assert again.sensors.infos == session.sensors.infos


def test_a_slow_listener_loses_the_oldest_and_knows_how_many() -> None:
    line = VirtualLine()
    reader = TrafficReader(limit=100)
    line.session.listen(reader, line.now_us)
    line.open()
    newest = reader.take()[-1].number
    assert reader.lost == 0
    line.run(3)
    taken = reader.take()
    assert len(taken) == 100
    assert reader.lost == taken[0].number - newest - 1 > 0
    numbers = [record.number for record in taken]
    assert numbers == list(range(numbers[0], numbers[0] + 100))
    line.run(0.1)
    before = reader.lost
    assert reader.take()[0].number == numbers[-1] + 1
    assert reader.lost == before


def test_a_record_that_another_threads_has_overtaken_is_not_lost() -> None:
    reader = TrafficReader(limit=10)
    for order in ([5, 7], [6, 9, 8], [10], [12], [11]):
        for number in order:
            reader.append(Record(number, Kind.ADVANCED, 0))
        assert [record.number for record in reader.take()] == order
    assert reader.lost == 0
    for number in range(13, 30):
        reader.append(Record(number, Kind.ADVANCED, 0))
    assert len(reader.take()) == 10
    assert reader.lost == 7


@pytest.mark.parametrize("data", [b"", b"[]", b"{}", b'{"phase": "NOWHERE"}', b"\xff"])
def test_an_invalid_start_state_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r".+"):
        Rerun().feed(Record(0, Kind.START, 0, data))


def test_damaged_records_are_refused() -> None:
    line = VirtualLine()
    reader = listened(line)
    line.open()
    again = Rerun()
    again.feed_all(reader.take())
    damaged = [(Kind.VELOCITY, b""), (Kind.NONCE, b""), (Kind.STOP, b""), (Kind.WITHDRAWN, b"1")]
    for kind, data in damaged:
        with pytest.raises(ValueError, match="damaged"):
            again.feed(Record(0, kind, line.now_us, data))
