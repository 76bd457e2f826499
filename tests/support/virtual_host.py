"""A host's session in virtual time; what it speaks to is up to the classes derived from this."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from random import Random
from typing import TypeVar

from wheelwire.errors import WheelwireError
from wheelwire.link.requests import Answer, RequestMessage
from wheelwire.link.session import Phase, Session
from wheelwire.link.statistics import LinkStatistics
from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.types import SetDuty, SetWheelVelocity

TIMEOUT_S = 5.0
ARMING_S = 1.01
"""More than rearm_gap_s and ttl_max_s by default."""
Outcomes = list[Answer | WheelwireError]
Self = TypeVar("Self", bound="VirtualHost")


class VirtualHost(ABC):
    """Time passes only in `step`, and in what calls it.

    Args:
        seed: Of the session's nonces.
        stream_rate_hz: Of the session.
        watched: Of the session.
    """

    def __init__(
        self, seed: int, stream_rate_hz: int | None = None, watched: tuple[int, ...] = ()
    ) -> None:
        self.random = Random(seed)
        self.session = Session(lambda: self.random.getrandbits(32), stream_rate_hz, watched)
        self.now_us = self.end_us = 0
        self.samples: list[WheelSample] = []

    @abstractmethod
    def step(self) -> object:
        """Let a moment pass; not beyond `end_us` if moments differ in length."""

    @abstractmethod
    def write(self, setpoint: bytes = b"") -> None:
        """Send the session's output, then a setpoint."""

    @property
    def statistics(self) -> LinkStatistics:
        """The session's counters."""
        return self.session.statistics(self.now_us)

    @property
    def sample(self) -> WheelSample:
        """The newest sample."""
        return self.samples[-1]

    def open(self: Self) -> Self:
        """Connect, wait until the session is open and a sample of it is here, and be armed."""
        self.session.connect(self.now_us)
        self.wait_open()
        self.arm()
        return self

    def arm(self) -> None:
        """Pause for as long as the device asks for after its start."""
        self.run(ARMING_S)

    def wait_open(self: Self) -> Self:
        """Wait for an open session and a further sample."""
        known = len(self.samples)
        self.run_until(lambda: self.session.phase is Phase.OPEN and len(self.samples) > known)
        return self

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.end_us = end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.step()

    def run_until(self, condition: Callable[[], bool], timeout_s: float = TIMEOUT_S) -> None:
        """Let time pass until `condition()` holds; fails when it does not within `timeout_s`."""
        self.end_us = end_us = self.now_us + round(timeout_s * 1e6)
        while not condition():
            assert self.now_us < end_us, "the condition never held"
            self.step()

    def set_velocity(self, left_mps: float, right_mps: float, ttl_s: float = 0.5) -> None:
        """Send one setpoint."""
        expiry_us = self.now_us + round(ttl_s * 1e6)
        frame = self.session.setpoints.frame
        self.write(frame(SetWheelVelocity, left_mps, right_mps, expiry_us, self.now_us))

    def set_duty(self, left: float, right: float, ttl_s: float = 0.5) -> None:
        """Send one open-loop setpoint."""
        expiry_us = self.now_us + round(ttl_s * 1e6)
        self.write(self.session.setpoints.frame(SetDuty, left, right, expiry_us, self.now_us))

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop, and wait for the acknowledgement."""
        self.wait(self.post_stop(mode))

    def estop(self) -> None:
        """Stop and latch, and wait for the acknowledgement."""
        self.wait(self.post_stop(None))

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer. Raises what the device refuses."""
        return self.wait(self.post(message))

    def post(self, message: RequestMessage) -> Outcomes:
        """Send a request; its outcome will be in the list that this returns."""
        outcomes: Outcomes = []
        self.session.request(message, outcomes.append, self.now_us)
        return outcomes

    def post_stop(self, mode: StopMode | None = StopMode.CONFIGURED) -> Outcomes:
        """As `post`, a stop; an e-stop with None."""
        outcomes: Outcomes = []
        self.session.stop(mode, outcomes.append, self.now_us)
        return outcomes

    def wait(self, results: Outcomes) -> Answer:
        """Wait for the outcome of a call; an error is raised."""
        self.run_until(lambda: bool(results))
        if isinstance(results[0], WheelwireError):
            raise results[0]
        return results[0]
