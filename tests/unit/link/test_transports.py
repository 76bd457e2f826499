import errno
import os
import socket
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

from support.processes import open_files, opened_since
from wheelwire.errors import LinkLost, PortUnavailable
from wheelwire.link.transports import SerialTransport, open_transport


class RecordingSerial:
    """Stands in for pyserial and notes what is done to it."""

    actions: list[tuple[str, object]]

    def __init__(self, file: int) -> None:
        self.__dict__.update(actions=[], file=file)

    def __setattr__(self, name: str, value: object) -> None:
        self.actions.append((name, value))

    def fileno(self) -> int:
        return int(self.__dict__["file"])

    def set_low_latency_mode(self, on: bool) -> None:
        self.actions.append(("low latency", on))

    def close(self) -> None:
        self.actions.append(("close", None))


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(slave)
    os.close(master)


def test_modem_lines_are_left_alone_at_opening_and_cleared_in_order_at_closing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    port = RecordingSerial(os.open(tmp_path / "no-terminal", os.O_CREAT | os.O_RDWR))
    seen: dict[str, Any] = {}
    monkeypatch.setattr(serial, "serial_for_url", lambda _, **options: seen.update(options) or port)
    transport = SerialTransport("/dev/x", 921_600)
    assert seen == {"baudrate": 921_600, "timeout": 0, "exclusive": True}
    assert transport.low_latency is True
    transport.close()
    assert port.actions == [("low latency", True), ("rts", False), ("dtr", False)]
    assert transport.write(b"late") == 4  # by another thread, which reaches no other file
    del transport
    assert port.actions[-1] == ("close", None)


@pytest.mark.parametrize(
    ("number", "remedy"),
    [
        (errno.EACCES, "dialout"),
        (errno.EBUSY, "another program"),
        (errno.ENOENT, "wheelwire ports"),
        (errno.EIO, "plug it in again"),
        (errno.ENOSPC, "No space left"),
    ],
)
def test_a_port_that_cannot_be_opened_is_reported_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, number: int, remedy: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise serial.SerialException(number, os.strerror(number))

    monkeypatch.setattr(serial, "serial_for_url", fail)
    with pytest.raises(PortUnavailable, match=remedy):
        open_transport("/dev/x", 115_200)


def test_bytes_go_both_ways_without_blocking(pty: tuple[int, str]) -> None:
    master, name = pty
    transport = open_transport(name, 115_200)
    assert transport.read() == b""
    assert transport.write(b"abc") == 3
    assert os.read(master, 10) == b"abc"
    os.write(master, b"xyz")
    assert transport.read() == b"xyz"
    transport.set_baud_rate(230_400)
    assert transport.baud_rate == 230_400
    transport.close()
    transport.close()


def test_a_full_port_takes_what_fits(pty: tuple[int, str]) -> None:
    transport = open_transport(pty[1], 115_200)
    sent = 0
    while written := transport.write(bytes(4096)):
        sent += written
    assert 0 < sent < 1_000_000
    transport.close()


def test_a_port_whose_other_end_is_gone_is_lost() -> None:
    master, slave = os.openpty()
    transport = open_transport(os.ttyname(slave), 115_200)
    os.close(slave)
    os.close(master)
    with pytest.raises(LinkLost, match="unplugged"):
        transport.write(b"x")
    transport.close()


def test_a_port_that_a_forked_process_gave_up_writes_into_no_other_file(
    pty: tuple[int, str], tmp_path: Path
) -> None:
    transport = SerialTransport(pty[1], 115_200)
    number = transport.fileno()
    transport.abandon()
    other = os.open(tmp_path / "log", os.O_RDWR | os.O_CREAT)
    assert other == number  # the lowest that is free
    with pytest.raises(LinkLost):
        transport.write(b"setpoint")
    assert os.fstat(other).st_size == 0
    os.close(other)
    transport.close()


def test_closing_what_was_abandoned_leaks_no_descriptor(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "robot"))
        listener.listen()
        transport = open_transport(f"unix:{tmp_path / 'robot'}", 0)
        transport.abandon()
        before = open_files()
        transport.close()
        assert not opened_since(before)


@pytest.mark.parametrize("kind", ["unix", "tcp"])
def test_a_socket_is_a_port(tmp_path: Path, kind: str) -> None:
    with socket.socket(socket.AF_UNIX if kind == "unix" else socket.AF_INET) as server:
        server.bind(str(tmp_path / "mcu.sock") if kind == "unix" else ("127.0.0.1", 0))
        server.listen()
        name = server.getsockname()
        port = f"unix:{name}" if kind == "unix" else f"socket://127.0.0.1:{name[1]}"
        transport = open_transport(port, 921_600)
        peer, _ = server.accept()
    with peer:
        assert transport.port == port
        assert transport.baud_rate is None
        assert transport.write(b"hello") == 5
        assert peer.recv(100) == b"hello"
        peer.sendall(b"back")
        assert transport.read() == b"back"
    with pytest.raises(LinkLost, match="closed the connection"):
        transport.read()
    transport.close()


def test_a_unix_socket_without_a_listener_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "mcu.sock"
    with pytest.raises(PortUnavailable, match="no such port"):
        open_transport(f"unix:{path}", 921_600)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
        with pytest.raises(PortUnavailable, match="nobody listens"):
            open_transport(f"unix:{path}", 921_600)
