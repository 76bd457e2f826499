"""The process that moves a computer's pins, with only the test at its line.

A driver would start it again as soon as it ends, and hide what stopped the wheels.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import sys
import time
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from wheelwire.pi import launch
from wheelwire.pi.settings import McuSettings
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import AnyMessage, DeviceHello, Hello, Ping, Pong, SetDuty

from .processes import children
from .waiting import wait_until

Answer = TypeVar("Answer", DeviceHello, Pong)
TIMEOUT_S = 30.0
NONCE = 7
PINGS = 20
DUTY_Q15 = 9000
ARMING_US = 1_000_000
"""Life of the zero setpoint: it is not to run out on the way on a busy test machine."""


def now_us() -> int:
    return time.monotonic_ns() // 1000


class McuProcess:
    """Runs from its construction to the end of its `with` block.

    Args:
        settings: Without a socket.

    Attributes:
        guard: The process's id.
        offset_us: From the device's clock to the monotonic one.
        error_us: Of the offset, at most.
    """

    def __init__(self, settings: McuSettings) -> None:
        self._ours, theirs = socket.socketpair()
        with theirs:
            settings = replace(settings, socket=theirs.fileno(), parent=os.getpid())
            command = [sys.executable, "-m", "wheelwire.pi", settings.to_json()]
            self._process = launch.start(command, theirs.fileno())
        self.guard = self._process.pid
        self.offset_us = self.error_us = 0
        self._encoder, self._decoder = Encoder(), Decoder()
        self._session = self._command_seq = 0
        self._received: list[AnyMessage] = []

    def __enter__(self) -> McuProcess:
        return self

    def __exit__(self, *_: object) -> None:
        for pid in [*children(self.guard), self.guard] if self._process.poll() is None else []:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.wait()
        self._ours.close()

    @property
    def core(self) -> int:
        """The id of the process that steps the core."""
        return wait_until(lambda: children(self.guard), what="the core's process")[0]

    def answers(self, timeout_s: float) -> bool:
        """Whether something comes over the line within this time."""
        return bool(select.select([self._ours], [], [], timeout_s)[0])

    def open(self) -> McuProcess:
        """Wait for the start, open a session, compare the clocks, and arm by a zero setpoint."""
        line = b""
        while not line.endswith(b"\n"):
            assert self.answers(TIMEOUT_S), "no answer to the start"
            line += self._ours.recv(1)
        assert "limits" in json.loads(line)
        hello = self._ask(Hello(NONCE, PROTOCOL_VERSION, schema_hash()), DeviceHello)
        self._session = NONCE ^ hello.boot_id
        trips: list[tuple[int, int]] = []
        for number in range(PINGS):
            sent_us = now_us()
            pong = self._ask(Ping(self._session, number, sent_us), Pong)
            trip_us = now_us() - sent_us
            trips.append((trip_us, sent_us + trip_us // 2 - pong.received_us))
        trip_us, self.offset_us = min(trips)
        self.error_us = trip_us // 2 + 1
        self.drive(ARMING_US, duty_q15=0)
        return self

    def drive(self, life_us: int, duty_q15: int = DUTY_Q15) -> int:
        """Drive both wheels; returns the deadline on the monotonic clock."""
        self._command_seq += 1
        expiry_us = now_us() - self.offset_us + life_us
        self._send(SetDuty(self._session, self._command_seq, expiry_us, duty_q15, duty_q15))
        return expiry_us + self.offset_us

    def hang_up(self) -> None:
        """As an application that has ended."""
        self._ours.shutdown(socket.SHUT_RDWR)

    def wait(self) -> int:
        """The exit status of the guard."""
        return self._process.wait(TIMEOUT_S)

    def _send(self, message: AnyMessage) -> None:
        self._ours.sendall(self._encoder.encode(message))

    def _ask(self, message: AnyMessage, kind: type[Answer]) -> Answer:
        self._received.clear()
        self._send(message)
        while True:
            for received in self._received:
                if isinstance(received, kind):
                    return received
            assert self.answers(TIMEOUT_S), f"no {kind.__name__}"
            self._received += self._decoder.feed(self._ours.recv(4096))
