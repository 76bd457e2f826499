"""The core as a library in virtual time, with a host, and with ticks that a test sets."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from wheelwire.errors import WheelwireError
from wheelwire.link.requests import Answer, RequestMessage
from wheelwire.link.session import Phase, Session
from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import Board, ResetReason
from wheelwire_protocol.native import Core, Identity, Outputs

from .host_samples import received

TIMEOUT_US = 5_000_000


class LibraryRobot:
    """A robot whose ticks a test sets; nothing happens but in `step`."""

    def __init__(
        self,
        stored: bytes = b"",
        save: Callable[[bytes], bool] = lambda _block: True,
        board: Board = Board.LINUX,
    ) -> None:
        self.core = Core(Identity(0x1234, board, 7, ResetReason.POWER_ON), stored, save)
        self.now_us = 1_000_000
        self.left_ticks = 0
        self.right_ticks = 0
        self.contact_open = False
        self.illegal = (0, 0)
        self.samples: list[WheelSample] = []
        random = Random(1)
        self.session = Session(lambda: random.getrandbits(32))
        self.outputs: Outputs

    def start(self) -> LibraryRobot:
        self.outputs = self.core.start(self.now_us, self.left_ticks, self.right_ticks)
        return self

    def open(self) -> LibraryRobot:
        self.start()
        return self.connect()

    def connect(self) -> LibraryRobot:
        self.samples.clear()
        self.session.connect(self.now_us)
        self.run_until(lambda: self.session.phase is Phase.OPEN and bool(self.samples))
        return self

    def step(self) -> Outputs:
        self.session.advance(self.now_us)
        self._feed()
        self.now_us += self.outputs.period_us
        self.outputs = self.core.step(
            self.now_us,
            self.left_ticks,
            self.right_ticks,
            contact_open=self.contact_open,
            left_illegal=self.illegal[0],
            right_illegal=self.illegal[1],
        )
        self.samples += received(self.session, self.core.take(), self.now_us)
        return self.outputs

    def _feed(self, setpoint: bytes = b"") -> None:
        self.core.feed(self.session.take_output() + setpoint)

    def run_until(self, condition: Callable[[], bool]) -> None:
        end_us = self.now_us + TIMEOUT_US
        while not condition():
            assert self.now_us < end_us, "the condition never held"
            self.step()

    def set_velocity(self, left_mps: float, right_mps: float, ttl_us: int = 200_000) -> None:
        make = self.session.setpoints.velocity_frame
        self._feed(make(left_mps, right_mps, self.now_us + ttl_us, self.now_us))

    def set_duty(self, left: float, right: float, ttl_us: int = 200_000) -> None:
        make = self.session.setpoints.duty_frame
        self._feed(make(left, right, self.now_us + ttl_us, self.now_us))

    def request(self, message: RequestMessage) -> Answer:
        results: list[Answer | WheelwireError] = []
        self.session.request(message, results.append, self.now_us)
        self.run_until(lambda: bool(results))
        if isinstance(results[0], WheelwireError):
            raise results[0]
        return results[0]
