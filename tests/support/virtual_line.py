"""A session and the core on a bad line, in virtual time, all of it seeded."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from wheelwire.errors import WheelwireError
from wheelwire.link.requests import Answer, RequestMessage
from wheelwire.link.session import Phase, Session
from wheelwire.samples import WheelSample
from wheelwire.simulation.bad_line import Direction, Impairment
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import AnyMessage

from .core_device import CoreDevice
from .host_samples import received

STEP_US = 1_000
"""The longest jump of time."""
GOOD = Impairment(delay_us=200)


class VirtualLine:
    """A host and a device; time passes only in `run`.

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
        self.random = Random(seed)
        self.device = device or CoreDevice(seed=seed + 1)
        self.session = Session(lambda: self.random.getrandbits(32), stream_rate_hz, watched)
        self.to_device = Direction(to_device or GOOD, self.random)
        self.to_host = Direction(to_host or GOOD, self.random)
        self.now_us = 1_000_000
        self.samples: list[WheelSample] = []
        self.sent: list[AnyMessage] = []
        self._tap = Decoder()

    def step(self, end_us: int) -> None:
        """Jump to the next event, but not beyond `end_us`."""
        now = self.now_us
        events = (
            self.to_device.next_us,
            self.to_host.next_us,
            self.session.next_deadline_us,
        )
        coming = [event for event in events if event is not None and event > now]
        self.now_us = now = min([now + STEP_US, end_us, *coming])
        for piece in self.to_device.take(now):
            self.device.feed(piece, now)
        self.device.advance(now)
        for piece in self.to_host.take(now):
            self.samples += received(self.session, piece, now)
        due = self.session.next_deadline_us
        if due is not None and due <= now:
            self.session.advance(now)
        self.flush()

    def flush(self, setpoint: bytes = b"") -> None:
        """Put the output of both sides on the line, and a setpoint behind it."""
        self.to_host.send(self.device.take_output(), self.now_us)
        output = self.session.take_output() + setpoint
        self.sent += self._tap.feed(output)
        self.to_device.send(output, self.now_us)

    def run(self, seconds: float) -> None:
        end_us = self.now_us + round(seconds * 1e6)
        self.flush()
        while self.now_us < end_us:
            self.step(end_us)

    def run_until(self, condition: Callable[[], bool], timeout_s: float = 5.0) -> None:
        end_us = self.now_us + round(timeout_s * 1e6)
        self.flush()
        while not condition():
            assert self.now_us < end_us, "the condition never held"
            self.step(end_us)

    def open(self) -> VirtualLine:
        """Connect and wait for an open session and a sample of it."""
        self.session.connect(self.now_us)
        return self.wait_open()

    def wait_open(self) -> VirtualLine:
        known = len(self.samples)
        self.run_until(lambda: self.session.phase is Phase.OPEN and len(self.samples) > known)
        return self

    def drive(self, left: float = 0.1, right: float = 0.1, ttl_s: float = 0.5) -> None:
        """One velocity setpoint."""
        expiry_us = self.now_us + round(ttl_s * 1e6)
        self.flush(self.session.setpoints.velocity_frame(left, right, expiry_us, self.now_us))

    def request(self, message: RequestMessage) -> Answer | WheelwireError:
        """One request and its outcome."""
        outcome: list[Answer | WheelwireError] = []
        self.session.request(message, outcome.append, self.now_us)
        self.run_until(lambda: bool(outcome))
        return outcome[0]

    def sent_of(self, kind: type[AnyMessage]) -> list[AnyMessage]:
        return [message for message in self.sent if isinstance(message, kind)]
