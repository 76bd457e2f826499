"""A session and the core on a bad line, in virtual time, all of it seeded."""

from __future__ import annotations

from typing import TypeVar

from wheelwire.link.session import Phase
from wheelwire.simulation.bad_line import Direction, Impairment
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import AnyMessage

from .core_device import CoreDevice
from .host_samples import received
from .virtual_host import VirtualHost

M = TypeVar("M")
GOOD = Impairment(delay_us=200)


class VirtualLine(VirtualHost):
    """A host and a device.

    `sent` holds every message that the session put on the line.
    """

    def __init__(
        self,
        seed: int = 1,
        *,
        to_device: Impairment | None = None,
        to_host: Impairment | None = None,
        device: CoreDevice | None = None,
        stream_rate_hz: int | None = None,
        watched: tuple[int, ...] = (),
    ) -> None:
        super().__init__(seed, stream_rate_hz, watched)
        self.device = device or CoreDevice(seed=seed + 1)
        self.to_device = Direction(to_device or GOOD, self.random)
        self.to_host = Direction(to_host or GOOD, self.random)
        self.now_us = 1_000_000
        self.sent: list[AnyMessage] = []
        self._tap = Decoder()

    def arm(self) -> None:
        """As the base's."""
        gap_s = max(self.device.value(name) for name in ("rearm_gap_s", "ttl_max_s"))
        self.run(gap_s + 0.01)

    def step(self) -> None:
        """Jump to the next event."""
        self.write()
        now = self.now_us
        events = (
            self.end_us,
            self.to_device.next_us,
            self.to_host.next_us,
            self.session.next_deadline_us,
            self.device.next_us,
        )
        coming = [event for event in events if event is not None and event > now]
        self.now_us = now = min(coming, default=now + 1)
        for piece in self.to_device.take(now):
            self.device.feed(piece, now)
        self.device.advance(now)
        for piece in self.to_host.take(now):
            self.samples += received(self.session, piece, now)
        due = self.session.next_deadline_us
        if due is not None and due <= now:
            self.session.advance(now)
        self.write()

    def write(self, setpoint: bytes = b"") -> None:
        """Put the output of both sides on the line, then a setpoint."""
        self.to_host.send(self.device.take_output(), self.now_us)
        output = self.session.take_output() + setpoint
        if output:  # at most moments there is none
            self.sent += self._tap.feed(output)
            self.to_device.send(output, self.now_us)

    def drive(self, left: float = 0.1, right: float = 0.1, ttl_s: float = 0.5) -> None:
        """One velocity setpoint."""
        self.set_velocity(left, right, ttl_s)

    def reset_device(self) -> None:
        """Until a session of its new boot is open."""
        self.device.reset()
        self.run_until(lambda: self.session.phase is not Phase.OPEN)
        self.wait_open()

    def sent_of(self, kind: type[M]) -> list[M]:
        return [message for message in self.sent if isinstance(message, kind)]
