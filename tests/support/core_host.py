"""A session with a core in this process, in virtual time."""

from __future__ import annotations

from wheelwire.errors import WheelwireError
from wheelwire.link.requests import Answer, RequestMessage
from wheelwire.link.session import Phase, Session
from wheelwire_protocol.core import Core

PERIOD_US = 1000
ANSWER_TIMEOUT_US = 10_000_000


class CoreHost:
    """Asks a core, which it starts."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._now_us = 0
        # Any nonce will do: no other host is on this line.
        self._session = Session(lambda: 1)
        core.start(0, 0, 0)
        self._session.connect(0)
        while self._session.phase is not Phase.OPEN:
            self._turn()

    def ask(self, message: RequestMessage) -> None:
        """Send a request and wait for its answer."""
        answers: list[Answer | WheelwireError] = []
        self._session.request(message, answers.append, self._now_us)
        while not answers:
            self._turn()
        if isinstance(answers[0], WheelwireError):
            raise answers[0]

    def _turn(self) -> None:
        if self._now_us > ANSWER_TIMEOUT_US:
            raise TimeoutError("the core does not answer")
        self._now_us += PERIOD_US
        self._session.advance(self._now_us)
        self._core.feed(self._session.take_output())
        self._core.step(self._now_us, 0, 0)
        self._session.receive(self._core.take(), self._now_us)
