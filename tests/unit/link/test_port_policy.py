"""The port's policy in virtual time: when a port is given up, opened again, and closed for good."""

import pytest

from support.core_device import CoreDevice
from wheelwire.errors import DriverUnavailable, LinkLost, PortUnavailable, WrongBoard
from wheelwire.link.port_policy import (
    CHECK_US,
    FIRST_PAUSE_S,
    FIRST_US,
    STOP_ACK_TIMEOUT_US,
    UNANSWERED_US,
    WRONG_BOARD_PAUSE_S,
    LastStop,
    PortPolicy,
    Unanswered,
)
from wheelwire.link.session import Phase, Session

RATE = 115_200
LONGEST_PAUSE_S = 0.3


@pytest.fixture
def session() -> Session:
    return Session(lambda: 7)


@pytest.fixture
def policy(session: Session) -> PortPolicy:
    """The policy of a port that was opened at time 0."""
    policy = PortPolicy(0)
    policy.begin(RATE, LONGEST_PAUSE_S, session, 0)
    session.connect(0)
    return policy


def exchange(session: Session, device: CoreDevice, now_us: int) -> None:
    """What each side has to say reaches the other at once."""
    session.advance(now_us)
    device.feed(session.take_output(), now_us)
    device.advance(now_us)
    session.receive(device.take_output(), now_us)


def opened(session: Session, device: CoreDevice) -> int:
    """Let time pass until the session is open; returns it."""
    now_us = 0
    while session.phase is not Phase.OPEN:
        now_us += 1000
        exchange(session, device, now_us)
        assert now_us < FIRST_US
    return now_us


def test_the_first_attempt_is_made_at_once_and_the_others_ever_later(policy: PortPolicy) -> None:
    pauses = [policy.take_pause_s() for _ in range(5)]
    assert pauses == [0.0, FIRST_PAUSE_S, 2 * FIRST_PAUSE_S, 4 * FIRST_PAUSE_S, LONGEST_PAUSE_S]


def test_after_a_session_the_next_attempt_is_made_at_once_again(policy: PortPolicy) -> None:
    policy.take_pause_s()
    policy.take_pause_s()
    policy.session_opened()
    assert policy.take_pause_s() == 0.0


def test_a_port_that_opens_but_brings_no_session_is_opened_ever_later(
    policy: PortPolicy, session: Session
) -> None:
    policy.take_pause_s()
    policy.begin(RATE, LONGEST_PAUSE_S, session, 1000)
    assert policy.take_pause_s() == FIRST_PAUSE_S


def test_the_settings_are_checked_now_and_then(policy: PortPolicy) -> None:
    assert not policy.takes_check(CHECK_US - 1)
    assert policy.takes_check(CHECK_US)
    assert not policy.takes_check(2 * CHECK_US - 1)
    assert policy.takes_check(2 * CHECK_US)


def test_the_port_of_a_device_that_fell_silent_is_reopened(
    policy: PortPolicy, session: Session
) -> None:
    now_us = opened(session, CoreDevice())
    policy.judge(session, RATE, now_us)
    session.renew(LinkLost("say hello again"), now_us)
    policy.judge(session, RATE, now_us + UNANSWERED_US - 1)
    with pytest.raises(Unanswered, match="no longer answers"):
        policy.judge(session, RATE, now_us + UNANSWERED_US)


def test_a_port_without_a_rate_is_opened_with_none(session: Session) -> None:
    policy = PortPolicy(0)
    policy.begin(None, LONGEST_PAUSE_S, session, 0)
    assert policy.rate == 0


def test_another_board_is_left_alone_and_reported_once(
    policy: PortPolicy, session: Session
) -> None:
    opened(session, CoreDevice())
    session.disconnect(LinkLost("unplugged"))
    session.connect(FIRST_US)
    exchange(session, CoreDevice(board_id=1), FIRST_US)
    with pytest.raises(WrongBoard) as first:
        policy.judge(session, RATE, FIRST_US)
    assert policy.note_lost(first.value)
    assert policy.take_pause_s() == WRONG_BOARD_PAUSE_S
    assert policy.take_pause_s() == LONGEST_PAUSE_S
    assert not policy.note_lost(WrongBoard("expected", first.value.found))
    assert policy.note_lost(WrongBoard("expected", "a third"))


def test_a_port_that_nobody_answers_at_is_not_lost_itself(policy: PortPolicy) -> None:
    unplugged = LinkLost("unplugged")
    policy.note_lost(unplugged)
    assert policy.lost is unplugged
    policy.note_lost(Unanswered("reopening"))
    assert policy.lost is None


def test_a_missing_port_is_not_reported_but_other_failures_are(policy: PortPolicy) -> None:
    assert policy.error_of_failure(PortUnavailable("port", "gone")) is None
    news = policy.error_of_failure(DriverUnavailable("pigpiod does not run"))
    assert str(news) == "pigpiod does not run; trying again"


def test_the_last_stop_is_over_when_it_was_written_and_acknowledged(session: Session) -> None:
    device = CoreDevice()
    session.connect(0)
    now_us = opened(session, device)
    stop = LastStop()
    assert not stop.is_over(now_us, all_written=True)
    stop.begin(session, now_us)
    assert stop.begun
    assert not stop.is_over(now_us, all_written=True)
    exchange(session, device, now_us)
    assert not stop.is_over(now_us, all_written=False)
    assert stop.is_over(now_us, all_written=True)


def test_the_last_stop_has_its_time(session: Session) -> None:
    session.connect(0)
    now_us = opened(session, CoreDevice())
    stop = LastStop()
    stop.begin(session, now_us)
    assert not stop.is_over(now_us + STOP_ACK_TIMEOUT_US - 1, all_written=True)
    assert stop.is_over(now_us + STOP_ACK_TIMEOUT_US, all_written=False)


def test_without_a_session_the_last_stop_is_over_once_it_is_written(session: Session) -> None:
    session.connect(0)
    stop = LastStop()
    stop.begin(session, 0)
    assert not stop.is_over(0, all_written=False)
    assert stop.is_over(0, all_written=True)
