from collections.abc import Callable

import pytest

from support.virtual_line import VirtualLine
from wheelwire.errors import LinkLost, RequestTimeout
from wheelwire.link.requests import REPEAT_US, RequestMessage, RequestQueue
from wheelwire.simulation.bad_line import Impairment
from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import RefusalCode, StopMode
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    ClearEstop,
    ClearFault,
    Estop,
    ParameterGet,
    ParameterSet,
    ParameterValue,
    Refuse,
    Stop,
)

each_stop = pytest.mark.parametrize("mode", [StopMode.BRAKE, None])
"""A stop in a mode, and an e-stop."""


def kind_of(mode: StopMode | None) -> type[Stop | Estop]:
    return Estop if mode is None else Stop


def test_a_request_is_repeated_unchanged_and_done_once(line: VirtualLine) -> None:
    line.to_host.impairment.loss = 1.0
    outcomes = line.post(ParameterSet(0, 0, 6, 0.25))
    line.run(0.5)
    line.to_host.impairment.loss = 0.0
    line.run_until(lambda: bool(outcomes))
    copies = line.sent_of(ParameterSet)
    assert len(copies) >= 3
    assert len(set(copies)) == 1
    assert len(line.device.asked(ParameterSet)) == 1
    assert isinstance(outcomes[0], ParameterValue)
    assert line.statistics.requests_repeated == len(copies) - 1


def test_a_lost_answer_is_asked_for_soon_and_then_ever_less_often(line: VirtualLine) -> None:
    line.device.mute = True
    outcomes = line.post(ParameterGet(0, 0, 1))
    copies: list[int] = []
    begin_us = line.now_us
    for _ in range(4):
        line.run_until(lambda: len(line.sent_of(ParameterGet)) > len(copies))
        copies.append(line.now_us - begin_us)
    assert copies == pytest.approx([0, 25_000, 75_000, 175_000], abs=2_000)
    line.run_until(lambda: bool(outcomes))
    assert line.now_us - begin_us == pytest.approx(1_000_000, rel=0.1)
    assert len(line.sent_of(ParameterGet)) <= 12


def test_requests_go_one_at_a_time_in_order(line: VirtualLine) -> None:
    line.device.mute = True
    outcomes = [line.post(ParameterGet(0, 0, parameter)) for parameter in (1, 2, 3)]
    line.run(0.3)
    assert {m.parameter for m in line.sent_of(ParameterGet)} == {1}
    line.device.mute = False
    line.run_until(lambda: all(outcomes))
    assert [m.parameter for m in dict.fromkeys(line.sent_of(ParameterGet))] == [1, 2, 3]
    assert all(isinstance(outcome, ParameterValue) for (outcome,) in outcomes)


@each_stop
def test_a_stop_overtakes_a_request_that_waits(line: VirtualLine, mode: StopMode | None) -> None:
    line.to_device.impairment.loss = 1.0
    answers = line.post(ParameterGet(0, 0, 1))
    line.run(0.005)
    line.to_device.impairment.loss = 0.0
    outcomes = line.post_stop(mode)
    line.run_until(lambda: bool(outcomes), timeout_s=0.01)
    assert isinstance(outcomes[0], Ack)
    assert answers == []


@each_stop
def test_a_stop_is_repeated_forty_times_a_second_before_it_is_given_up(
    line: VirtualLine, mode: StopMode | None
) -> None:
    line.device.mute = True
    begin_us = line.now_us
    outcomes = line.post_stop(mode)
    line.run_until(lambda: bool(outcomes))
    assert isinstance(outcomes[0], RequestTimeout)
    assert len(line.sent_of(kind_of(mode))) == 40
    assert line.now_us - begin_us == pytest.approx(1_000_000, abs=2_000)


@pytest.mark.parametrize(
    ("asked", "answer"),
    [
        (ParameterGet(0, 0, 1), Ack(0, 1, message_id(ParameterGet))),
        (ParameterGet(0, 0, 1), Refuse(0, message_id(ParameterSet), RefusalCode.OUT_OF_RANGE, 1)),
        (ParameterGet(0, 0, 1), ParameterValue(0, 2, 1, 5.0)),
        (ClearFault(0, 0), Ack(0, 1, message_id(ClearEstop))),
    ],
)
def test_what_does_not_answer_the_request_that_is_open_is_foreign(
    line: VirtualLine, asked: RequestMessage, answer: Ack | Refuse
) -> None:
    line.device.mute = True
    outcomes = line.post(asked)
    foreign = line.statistics.foreign
    line.device.send(answer._replace(session_id=line.device.session_id))
    line.run(0.01)
    assert outcomes == []
    assert line.statistics.foreign == foreign + 1


def test_neither_stops_nor_pings_make_the_next_request_an_old_one(line: VirtualLine) -> None:
    """The device takes an id that is ahead by more than 32767 for an old one, and is silent."""
    for _ in range(3):
        assert isinstance(line.request(ParameterGet(0, 0, 1)), ParameterValue)
        for _ in range(3):
            line.post_stop()
            line.post_stop(None)
        line.run(1.0)
    assert [m.request_id for m in line.sent_of(ParameterGet)] == [1, 2, 3]


def test_request_ids_wrap_at_65536() -> None:
    sent: list[AnyMessage] = []
    queue = RequestQueue(sent.append)
    for _ in range(65537):
        queue.submit(ParameterGet(7, 0, 1), lambda _: None, 0)
        request = sent[-1]
        assert isinstance(request, ParameterGet)
        answer = ParameterValue(7, request.request_id, 1, 0.5)
        asked = queue.answered_by(answer)
        assert asked is not None
        assert asked.message == request
        queue.finish(asked, answer, 0)
    # Without 0, which copies of stops have.
    assert [m.request_id for m in sent[-3:] if isinstance(m, ParameterGet)] == [65535, 1, 2]


def test_a_thread_claims_the_line_only_where_nothing_is_on_its_way() -> None:
    sent: list[AnyMessage] = []
    results: list[object] = []
    queue = RequestQueue(sent.append)
    claimed = queue.claim(ParameterGet(0, 0, 1), results.append, 0)
    assert claimed is not None
    assert queue.claim(ParameterGet(0, 0, 2), results.append, 0) is None
    queue.submit(ParameterGet(7, 0, 3), results.append, 0)
    assert not sent, "a request overtook the one that its thread is about to write"
    queue.begin(claimed, 7)
    assert claimed.message == ParameterGet(7, 1, 1)
    answer = ParameterValue(7, 1, 1, 0.5)
    asked = queue.answered_by(answer)
    assert asked is claimed
    queue.finish(asked, answer, 0)
    assert results == [answer]
    assert sent == [ParameterGet(7, 2, 3)]
    assert queue.claim(ParameterGet(0, 0, 4), results.append, 0) is None, "the line had a gap"


def test_what_a_thread_has_begun_is_repeated_like_any_other() -> None:
    sent: list[AnyMessage] = []
    queue = RequestQueue(sent.append)
    claimed = queue.claim(ParameterGet(0, 0, 1), lambda _: None, 0)
    assert claimed is not None
    queue.advance(REPEAT_US)  # the thread that has claimed the line was held up
    assert not sent
    queue.begin(claimed, 7)
    queue.advance(2 * REPEAT_US)
    assert sent == [claimed.message]


def test_what_was_claimed_and_given_up_is_never_sent() -> None:
    sent: list[AnyMessage] = []
    queue = RequestQueue(sent.append)
    done: Callable[[object], None] = list[object]().append
    assert queue.claim(ParameterGet(0, 0, 1), done, 0) is not None
    queue.withdraw(done)
    queue.submit(ParameterGet(7, 0, 2), lambda _: None, 0)
    queue.advance(REPEAT_US)
    assert sent == [ParameterGet(7, 1, 2)]


def test_the_end_of_a_session_ends_what_was_claimed() -> None:
    results: list[object] = []
    queue = RequestQueue(lambda _: None)
    claimed = queue.claim(ParameterGet(0, 0, 1), results.append, 0)
    assert claimed is not None
    error = LinkLost("gone")
    queue.abort(error)
    assert results == [error]
    assert not queue.release_claimed(claimed)


def test_a_snapshot_counts_the_id_that_a_thread_is_about_to_draw() -> None:
    queue = RequestQueue(lambda _: None)
    claimed = queue.claim(ParameterGet(0, 0, 1), lambda _: None, 0)
    assert claimed is not None
    before = queue.snapshot()
    queue.begin(claimed, 7)
    assert before == queue.snapshot() == [(False, 1)]


def test_request_ids_restart_in_a_new_session() -> None:
    line = VirtualLine(watched=(1, 2)).open()
    line.reset_device()
    ids = [m.request_id for m in line.sent_of(ParameterGet)]
    assert ids == [1, 2, 1, 2]


def test_an_answer_that_comes_twice_is_taken_once() -> None:
    line = VirtualLine(to_host=Impairment(repeat=1.0, delay_us=200), watched=(1,)).open()
    foreign = line.statistics.foreign
    assert isinstance(line.request(ParameterSet(0, 0, 1, 0.05)), ParameterValue)
    line.run(0.01)
    assert line.statistics.foreign == foreign + 1
    assert line.session.reported.values[1] == pytest.approx(0.05)


def test_disconnecting_ends_every_request_though_one_caller_fails(line: VirtualLine) -> None:
    def fail(_result: object) -> None:
        raise ValueError("a bug")

    line.device.mute = True
    outcomes: list[object] = []
    for done in (outcomes.append, fail, outcomes.append):
        line.session.request(ParameterGet(0, 0, 1), done, line.now_us)
    with pytest.raises(ValueError, match="a bug"):
        line.session.disconnect(LinkLost("unplugged"))
    assert [str(outcome) for outcome in outcomes] == ["unplugged"] * 2
    assert line.session.next_deadline_us is None
    with pytest.raises(LinkLost, match="unplugged"):
        line.drive()


def test_a_stop_without_a_session_is_sent_all_the_same() -> None:
    line = VirtualLine()
    line.device.mute = True
    line.session.connect(line.now_us)
    (outcome,) = line.post_stop()
    assert isinstance(outcome, LinkLost)
    line.run(0.01)
    assert line.device.count(Stop) > 0


@each_stop
def test_a_stop_that_is_withdrawn_is_not_repeated(line: VirtualLine, mode: StopMode | None) -> None:
    line.device.mute = True
    outcomes = line.post_stop(mode)
    line.run(0.06)
    copies = len(line.sent_of(kind_of(mode)))
    assert copies > 1
    line.session.withdraw(outcomes.append)
    line.run(0.5)
    assert len(line.sent_of(kind_of(mode))) == copies
    assert outcomes == []


def test_a_request_that_is_withdrawn_is_not_repeated_and_lets_the_next_one_pass(
    line: VirtualLine,
) -> None:
    line.device.mute = True
    withdrawn = line.post(ClearEstop(0, 0))
    outcomes = line.post(ParameterGet(0, 0, 1))
    line.run(0.01)
    line.session.withdraw(withdrawn.append)
    line.device.mute = False
    line.run_until(lambda: bool(outcomes))
    assert isinstance(outcomes[0], ParameterValue)
    assert len(line.sent_of(ClearEstop)) == 1


def test_a_request_that_is_withdrawn_before_its_turn_is_not_sent(line: VirtualLine) -> None:
    first = line.post(ParameterGet(0, 0, 1))
    withdrawn = line.post(ClearEstop(0, 0))
    line.session.withdraw(withdrawn.append)
    last = line.post(ParameterGet(0, 0, 2))
    line.run_until(lambda: bool(first and last))
    assert line.sent_of(ClearEstop) == []
    assert withdrawn == []
