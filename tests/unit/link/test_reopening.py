"""A link whose transport is opened by a function, as the drivers of this computer's pins do."""

import socket
import threading
import time
from contextlib import suppress

import pytest

from support.core_device import CoreDevice
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.link.clock import host_clock_us
from wheelwire.link.connection import Link, LinkOptions
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.transports import SocketTransport, Transport


class PausingTransport(SocketTransport):
    gone = "the process has ended"
    longest_pause_s = 0.2


class Places:
    """Opens transports to robots, or fails; notes when."""

    def __init__(self) -> None:
        self.opened_s: list[float] = []
        self.failure: errors.WheelwireError | None = None
        self.hangs_up_at_once = False
        self._peers: list[socket.socket] = []

    def open(self, _baud_rate: int) -> Transport:
        self.opened_s.append(time.monotonic())
        if self.failure is not None:
            raise self.failure
        ours, peer = socket.socketpair()
        if self.hangs_up_at_once:
            peer.close()
        else:
            self._peers.append(peer)
            threading.Thread(target=_serve, args=(peer,), daemon=True).start()
        transport = PausingTransport(ours)
        transport.port = "a process"
        return transport

    def hang_up(self) -> None:
        self._peers[-1].shutdown(socket.SHUT_RDWR)


def _serve(peer: socket.socket) -> None:
    device = CoreDevice()
    with peer, suppress(ConnectionError):  # the link hangs up whenever it likes
        while data := peer.recv(4096):
            device.feed(data, host_clock_us())
            peer.sendall(device.take_output())


@pytest.fixture
def places() -> Places:
    return Places()


def open_link(places: Places) -> Link:
    link = Link(LinkOptions("a process", open_port=places.open), LatestSample())
    link.open()
    return link


def is_open(link: Link) -> bool:
    try:
        link.check()
    except errors.LinkLost:
        return False
    return True


def test_any_failure_to_reopen_is_reported_and_retried(places: Places) -> None:
    link = open_link(places)
    places.failure = errors.DriverUnavailable("pigpiod does not run")
    places.hang_up()
    wait_until(lambda: len(places.opened_s) >= 4)
    with pytest.raises(errors.LinkLost, match="pigpiod does not run; trying again"):
        link.check()
    places.failure = None
    wait_until(lambda: is_open(link))
    assert link.statistics.reconnects == 1
    link.close()


def test_what_ends_at_once_is_not_opened_without_pause(places: Places) -> None:
    link = open_link(places)
    places.hangs_up_at_once = True
    places.hang_up()
    wait_until(lambda: len(places.opened_s) >= 6)
    pauses = [b - a for a, b in zip(places.opened_s[2:], places.opened_s[3:], strict=False)]
    assert all(pause > 0.09 for pause in pauses[1:])

    def says_why() -> bool:
        """Not in the moment after the port was opened once more."""
        with pytest.raises(errors.LinkLost) as raised:
            link.check()
        return "the process has ended" in str(raised.value)

    wait_until(says_why)
    places.hangs_up_at_once = False
    wait_until(lambda: is_open(link))
    link.close()
