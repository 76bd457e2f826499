"""A robot is opened, or what another program offers of it: which of them is tried first."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import pytest

from wheelwire.drivers.attached import AttachedDriver
from wheelwire.errors import PortUnavailable
from wheelwire.log.share.attached_link import Holder
from wheelwire.log.share.wire import MessageReader
from wheelwire.pi.pins import Pins
from wheelwire.tools import attach
from wheelwire.tools.attach import open_or_attach

BOARD_ID = "240ac4123456"


class Places:
    """What was tried, in order.

    Attributes:
        peer: The other end of the newest connection to a holder; None while there is to be none.
        is_in_use: Whether opening fails because a program has the port open.
        offered_after: How often a holder is looked for before it offers its link.
    """

    def __init__(self) -> None:
        self.tried: list[Any] = []
        self.peer: socket.socket | None = None
        self.is_in_use = False
        self.offered_after = 0

    def find_holder(self, identity: str, board_id: str) -> Holder | None:
        self.tried.append((identity, board_id))
        if self.peer is None or len(self.tried) <= self.offered_after:
            return None
        ours, peer = socket.socketpair()
        # Closed already, it is the connection to a program that has just ended.
        if self.peer.fileno() < 0:
            peer.close()
        self.peer.close()
        self.peer = peer
        return Holder("p, process 1", identity, "", board_id, ours, MessageReader(1), [])

    def open_driver(self, _name: str, **options: Any) -> None:
        self.tried.append("open")
        raise PortUnavailable(options["port"], "in use", is_in_use=self.is_in_use)


@pytest.fixture
def places(monkeypatch: pytest.MonkeyPatch) -> Places:
    places = Places()
    monkeypatch.setattr(attach, "find_holder", places.find_holder)
    monkeypatch.setattr(attach, "open_driver", places.open_driver)
    return places


@pytest.fixture
def peer(places: Places) -> Iterator[socket.socket]:
    """Somebody holds whatever is asked for."""
    places.peer, other = socket.socketpair()
    with other:
        yield places.peer
        places.peer.close()


@pytest.mark.parametrize(
    ("options", "tried"),
    [
        ({"port": "/dev/ttyUSB0"}, ["open", ("/dev/ttyUSB0", "")]),
        ({"port": "unix:/run/x"}, [("unix:/run/x", ""), "open", ("unix:/run/x", "")]),
        ({"port": "socket://a:1"}, [("socket://a:1", ""), "open", ("socket://a:1", "")]),
        (
            {"port": "/dev/tty*", "board_id": BOARD_ID.upper()},
            [("/dev/tty*", BOARD_ID), "open", ("/dev/tty*", BOARD_ID)],
        ),
    ],
)
def test_opening_comes_first_where_it_costs_nobody_anything(
    places: Places, options: dict[str, Any], tried: list[Any]
) -> None:
    with pytest.raises(PortUnavailable):
        open_or_attach("serial", options)
    assert places.tried == tried


@pytest.mark.usefixtures("peer")
def test_pins_are_found_by_their_wiring(places: Places) -> None:
    robots: list[tuple[str, dict[str, Any]]] = [
        ("l298n", {}),
        ("l298n", {"pins": Pins(left_pwm=12)}),
        ("pigpio", {}),
        ("pigpio", {"host": "elsewhere"}),
    ]
    for name, options in robots:
        open_or_attach(name, options, listens=False).close()
    found = [identity for identity, _ in places.tried]
    assert len(set(found)) == len(robots)


def test_mock_never_attaches_to_another_program(places: Places) -> None:
    with pytest.raises(PortUnavailable):
        open_or_attach("mock", {"port": "mock"})
    assert places.tried == ["open"]


def test_a_program_that_has_just_ended_holds_nothing(places: Places, peer: socket.socket) -> None:
    peer.close()
    with pytest.raises(PortUnavailable):
        open_or_attach("serial", {"port": "unix:x"})
    assert "open" in places.tried


@pytest.mark.usefixtures("peer")
def test_a_program_that_has_just_opened_the_port_is_waited_for(places: Places) -> None:
    places.is_in_use, places.offered_after = True, 4
    open_or_attach("serial", {"port": "/dev/ttyUSB0"}, listens=False).close()
    assert places.tried == ["open", *[("/dev/ttyUSB0", "")] * 4]


def test_a_program_that_never_offers_its_link_is_not_waited_for_long(
    places: Places, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(attach, "OFFER_S", 0.1)
    places.is_in_use = True
    with pytest.raises(PortUnavailable):
        open_or_attach("serial", {"port": "/dev/ttyUSB0"})
    assert len(places.tried) > 2


@pytest.mark.usefixtures("peer")
def test_a_stop_alone_waits_for_nothing() -> None:
    robot = open_or_attach("serial", {"port": "unix:x"}, listens=False)
    assert isinstance(robot, AttachedDriver)
    assert robot.holder.name == "p, process 1"
    robot.close()
