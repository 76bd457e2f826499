"""Saying hello, and what the answer means. Sans-IO."""

from __future__ import annotations

from collections.abc import Callable

from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.schema import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.types import DeviceHello, Hello

from .device import DeviceInfo, device_release, host_release
from .errors import DeviceRefused, LinkLost, ProtocolMismatch

PERIOD_US = 30_000


class Greeting:
    """Hello, repeated with one nonce until it is answered.

    Args:
        send: Takes a message for the line.
        draw_nonce: Draws 32 random bits, anew for each session.
    """

    def __init__(self, send: Callable[[Hello], None], draw_nonce: Callable[[], int]) -> None:
        self.nonce = 0
        self.due_us = 0
        """When to say it, or say it again."""
        self._send = send
        self._draw_nonce = draw_nonce

    def begin(self, now_us: int, pause_us: int = 0) -> None:
        """Say hello for a new session, after a pause."""
        self.nonce = self._draw_nonce()
        self.due_us = now_us + pause_us
        self.advance(now_us)

    def advance(self, now_us: int) -> None:
        """Say it, or say it again, if it is time."""
        if now_us >= self.due_us:
            self.due_us = now_us + PERIOD_US
            self._send(Hello(self.nonce, PROTOCOL_VERSION, schema_hash()))

    def judge(self, hello: DeviceHello) -> DeviceInfo:
        """Who answered our hello and opened a session.

        Raises:
            ProtocolMismatch: Another release; no session.
            LinkLost: The device is still starting; no session yet.
            DeviceRefused: Another refusal; no session.
            ValueError: The answer has a code that means nothing.
        """
        if (hello.protocol_version, hello.schema_hash) != (PROTOCOL_VERSION, schema_hash()):
            raise ProtocolMismatch(host_release(), device_release(hello))
        if hello.refusal == RefusalCode.BOOTING:
            raise LinkLost("the device is still starting; wait a moment")
        if hello.refusal != RefusalCode.NONE:
            raise DeviceRefused(hello.refusal, "the session")
        return DeviceInfo.from_hello(hello)
