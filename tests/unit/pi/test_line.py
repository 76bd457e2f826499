"""The line to the application: what waits before one that does not read, and what becomes of it."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import pytest

from wheelwire.pi.line import ConnectedLine, ListeningLine
from wheelwire_protocol.core import Core

FRAME = 100
"""Bytes of each frame: its number, in each of them."""
MOST = 20_000
"""Bytes on their way to an application that does not read: a fifth of a second of states."""


Ends = tuple[ConnectedLine, socket.socket]
Service = tuple[ListeningLine, Path]
"""A line that listens, and where."""


class Frames:
    """Stands in for the core: has numbered frames to send."""

    def __init__(self, count: int) -> None:
        self.frames = deque(bytes([number % 251]) * FRAME for number in range(count))
        self.whole = b"".join(self.frames)

    def take(self) -> bytes:
        return self.frames.popleft() if self.frames else b""


def core(frames: Frames) -> Core:
    return cast("Core", frames)


@pytest.fixture
def ends() -> Iterator[Ends]:
    ours, theirs = socket.socketpair()
    line = ConnectedLine(ours.detach())
    theirs.settimeout(10)
    with theirs:
        yield line, theirs
    line.close()


def read(theirs: socket.socket, size: int) -> bytes:
    """What has come, up to that many bytes."""
    theirs.setblocking(False)
    data = b""
    try:
        while len(data) < size:
            part = theirs.recv(size - len(data))
            if not part:
                break
            data += part
    except BlockingIOError:
        pass
    return data


def test_bytes_that_do_not_fit_wait(ends: Ends) -> None:
    line, theirs = ends
    frames = Frames(200)
    got = b""
    for size in (0, 33, 1, FRAME, 4097, *[7000] * 50):
        line.send(core(frames))
        assert bool(frames.frames) == (line.wait_set()[1] != [])  # to be woken for the rest
        got += read(theirs, size)
    assert got == frames.whole


def test_little_waits_for_an_application_that_does_not_read(ends: Ends) -> None:
    line, _ = ends
    frames = Frames(2000)
    line.send(core(frames))
    assert len(frames.whole) - len(frames.frames) * FRAME < MOST


def test_an_application_that_has_nothing_to_say_has_not_hung_up(ends: Ends) -> None:
    line, theirs = ends
    readable = line.wait_set()[0]
    assert line.receive(readable) == b""
    assert line.receive([]) == b""
    assert not line.hung_up
    theirs.sendall(b"stop")
    assert line.receive(readable) == b"stop"
    assert not line.hung_up
    theirs.close()
    assert line.receive(readable) == b""
    assert line.hung_up
    assert not line.next_host()


def test_what_an_application_said_last_is_read_before_its_end(ends: Ends) -> None:
    line, theirs = ends
    theirs.sendall(b"stop")
    theirs.close()
    readable = line.wait_set()[0]
    line.send(core(Frames(1)))  # which finds that the other end is gone
    assert line.receive(readable) == b"stop"
    assert line.receive(readable) == b""
    assert line.hung_up


def test_a_send_to_nobody_is_an_end(ends: Ends) -> None:
    line, theirs = ends
    theirs.close()
    line.send(core(Frames(1)))
    assert line.hung_up


def connected(path: Path) -> socket.socket:
    host = socket.socket(socket.AF_UNIX)
    host.settimeout(10)
    host.connect(str(path))
    return host


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    path = tmp_path / "line"
    line = ListeningLine(path)
    yield line, path
    line.close()
    assert not path.exists()


def test_the_next_host_gets_nothing_that_was_for_the_one_before(service: Service) -> None:
    line, path = service
    with connected(path) as first:
        line.receive(line.wait_set()[0])
        line.send(core(Frames(2000)))  # more than fits
        first.close()
    assert line.receive(line.wait_set()[0]) == b""
    assert line.hung_up
    assert line.next_host()
    assert not line.hung_up
    with connected(path) as second:
        line.receive(line.wait_set()[0])
        frames = Frames(3)
        line.send(core(frames))
        assert read(second, 1000) == frames.whole


def test_while_nobody_is_connected_nothing_piles_up(service: Service) -> None:
    line, _ = service
    frames = Frames(1)
    line.send(core(frames))
    assert not frames.frames


def test_a_second_host_is_sent_away_and_the_first_one_stays(service: Service) -> None:
    line, path = service
    with connected(path) as first, connected(path) as second:
        for _ in range(2):
            line.receive(line.wait_set()[0][:1])
        assert second.recv(1) == b""
        first.sendall(b"stop")
        assert line.receive(line.wait_set()[0]) == b"stop"
        assert not line.hung_up


def test_a_host_that_hangs_up_is_no_end_of_the_service(service: Service) -> None:
    line, path = service
    for _ in range(3):
        with connected(path):
            line.receive(line.wait_set()[0][:1])
        line.receive(line.wait_set()[0])
        assert line.hung_up
        assert line.next_host()


class Narrow:
    """A socket that takes so many bytes of each send; none: it is full."""

    def __init__(self, *takes: int) -> None:
        self._takes = list(takes)
        self.taken = b""

    def send(self, data: bytes) -> int:
        size = self._takes.pop(0) if self._takes else len(data)
        if not size:
            raise BlockingIOError
        self.taken += data[:size]
        return min(size, len(data))

    def close(self) -> None: ...


@pytest.mark.parametrize("takes", [(1, 0), (99, 0), (100, 0), (50, 50, 7, 0), (0, 0, 33, 0)])
def test_a_frame_that_was_taken_in_part_goes_on_where_it_was_left(
    ends: Ends, takes: tuple[int, ...]
) -> None:
    line, _ = ends
    line.close()
    narrow = Narrow(*takes)
    line._host = cast("socket.socket", narrow)
    frames = Frames(5)
    for _ in range(4):
        line.send(core(frames))
    assert narrow.taken == frames.whole
