"""Which answers to a ping set the clock."""

from wheelwire.link.clock import BURST, MAX_DEVICE_US, Exchange, Synchroniser
from wheelwire_protocol.types import Ping, Pong

SENT_US, RECEIVED_US = 10_000, 12_000


def pinged() -> tuple[Synchroniser, Ping]:
    """One ping is in flight."""
    sent: list[Ping] = []
    synchroniser = Synchroniser(7, sent.append, 0)
    synchroniser.ping(SENT_US)
    return synchroniser, sent[0]


def test_an_answer_is_an_exchange_once() -> None:
    synchroniser, ping = pinged()
    pong = Pong(7, ping.request_id, ping.host_us, 500, 600)
    assert synchroniser.on_pong(pong, RECEIVED_US) == Exchange(SENT_US, 500, 600, RECEIVED_US)
    assert synchroniser.clock.synchronised
    assert synchroniser.on_pong(pong, RECEIVED_US) is None


def test_an_impossible_answer_sets_no_clock() -> None:
    synchroniser, ping = pinged()
    pong = Pong(7, ping.request_id, ping.host_us, 500, 600)
    for wrong in (
        pong._replace(request_id=ping.request_id + 1),
        pong._replace(host_us=ping.host_us - 1),  # that id, but of another ping
        pong._replace(received_us=601),  # sent before it came
        pong._replace(sent_us=10_000_000),  # held longer than all of the exchange took
        pong._replace(received_us=MAX_DEVICE_US + 1, sent_us=MAX_DEVICE_US + 1),
    ):
        assert synchroniser.on_pong(wrong, RECEIVED_US) is None
    assert not synchroniser.clock.synchronised


def test_pings_without_an_answer_make_no_clock() -> None:
    synchroniser, _ = pinged()
    for number in range(BURST):
        synchroniser.ping(SENT_US + number * 25_000)
    assert not synchroniser.ready
