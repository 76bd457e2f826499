"""The simplest possible host, one thread with `poll`, `read` and `write`, and an echo in C."""

from __future__ import annotations

import os
import select
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any

from wheelwire.link.transports import SerialTransport
from wheelwire_protocol import Decoder, Encoder
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    DeviceHello,
    Hello,
    Ping,
    Pong,
    SetStreamRate,
    SetWheelVelocity,
)

from .processes import talking

ECHO = Path(__file__).parents[2] / "bench" / "echo.c"
NONCE = 0x12345678
REQUEST_ID = 1
PING_SIZE = len(Encoder().encode(Ping(NONCE, REQUEST_ID, 0)))
PONG_SIZE = len(Encoder().encode(Pong(NONCE, REQUEST_ID, 0, 0, 0)))
"""Size of the whole frame: it does not depend on the content."""
TIMEOUT_S = 5.0
REPEAT_S = 0.1
NEVER_US = 1 << 50


@contextmanager
def echo_process(folder: Path) -> Iterator[str]:
    """Runs the echo in C behind a pseudo-terminal; yields the port's name."""
    program = folder / "echo"
    subprocess.run(["cc", "-O2", "-o", str(program), str(ECHO)], check=True)
    with talking(program, stdin=subprocess.PIPE) as (_, line):
        yield line.strip()


class BareHost:
    """A host without sessions, threads or clocks of its own.

    Args:
        port: Port of the firmware or the echo.
        baud_rate: Baud rate of the port.
    """

    def __init__(self, port: str, baud_rate: int) -> None:
        self._transport = SerialTransport(port, baud_rate)
        self._fd = self._transport.fileno()
        self._poller = select.poll()
        self._poller.register(self._fd, select.POLLIN)
        self._encoder = Encoder()
        self._session_id = 0
        self._command_seqs = count(1)

    def close(self) -> None:
        """Close the port; the device keeps running."""
        self._transport.close()

    def open_session(self, stream_rate_hz: int) -> None:
        """Open a session with a device."""
        hello = self._ask(Hello(NONCE, PROTOCOL_VERSION, schema_hash()), DeviceHello)
        self._session_id = NONCE ^ hello.boot_id
        self._ask(SetStreamRate(self._session_id, REQUEST_ID, stream_rate_hz), Ack)

    def arm(self) -> None:
        """Have a device obey the setpoints of the session: a ping, and a zero setpoint."""
        self.exchange()
        self.drive(0.0)

    def drive(self, velocity_mps: float) -> None:
        """Encode and write a setpoint that the device obeys for as long as it may."""
        setpoint = SetWheelVelocity(
            self._session_id, next(self._command_seqs), NEVER_US, velocity_mps, velocity_mps
        )
        os.write(self._fd, self._encoder.encode(setpoint))

    def drain(self) -> None:
        """Discard what has arrived."""
        while self._poller.poll(0):
            self._transport.read()

    def discard(self, seconds: float) -> None:
        """Read and discard what arrives in this time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._read()

    def hand_over(self, count: int) -> None:
        """Take so many reads from a thread that reads what arrives."""
        reads: SimpleQueue[bytes] = SimpleQueue()

        def read() -> None:
            for _ in range(count):
                reads.put(self._read())

        thread = Thread(target=read)
        thread.start()
        for _ in range(count):
            reads.get()
        thread.join()

    def exchange(self, answer_size: int = PONG_SIZE) -> float:
        """The round trip of a ping to a device that streams nothing, or to an echo. [s]"""
        ping = self._encoder.encode(Ping(self._session_id, REQUEST_ID, 0))
        # What the device reports each second would be taken for the answer, and the answer for the
        # next one's.
        self.drain()
        begin = time.perf_counter()
        self._transport.write(ping)
        size = 0
        while size < answer_size:
            size += len(self._read())
        return time.perf_counter() - begin

    def _read(self) -> bytes:
        if not self._poller.poll(TIMEOUT_S * 1e3):
            raise TimeoutError("nothing came")
        return self._transport.read()

    def _ask(self, request: AnyMessage, answer: type[AnyMessage]) -> Any:
        """Repeat it until it is answered: a device that is still starting does not receive it."""
        decoder = Decoder()
        end = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end:
            self._transport.write(self._encoder.encode(request))
            while self._poller.poll(REPEAT_S * 1e3):
                for message in decoder.feed(self._transport.read()):
                    if isinstance(message, answer):
                        return message
        raise TimeoutError(f"no {answer.__name__} came")
