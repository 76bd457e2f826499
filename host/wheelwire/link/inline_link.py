"""Links that answer by `post`; and one without a port, whose callers let its time pass."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import partial

from wheelwire_protocol.codes import StopMode

from ..errors import RequestTimeout, WheelwireError
from .connection import LinkInfo, SessionView
from .news import Happening, Listener
from .requests import Answer, Done, RequestMessage

STEP_S = 0.001
"""By how much time passes between two looks."""
ANSWER_S = 5.0


class PostedLink(SessionView):
    """A link whose every call is a `post` that is waited for."""

    _end: WheelwireError | None = None
    _listener: Listener | None = None

    @property
    @abstractmethod
    def name(self) -> str:
        """Name for messages."""

    @property
    def has_ended(self) -> bool:
        """The link is down for good."""
        return self._end is not None

    def request(self, message: RequestMessage) -> Answer:
        """As `Link.request`."""
        return self._result(partial(self.post, message))

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """As `Link.stop`."""
        self._result(partial(self.post_stop, mode=mode))

    def estop(self) -> None:
        """As `Link.estop`."""
        self._result(self.post_estop)

    @abstractmethod
    def post(self, message: RequestMessage, done: Done) -> None:
        """As `Link.post`."""

    @abstractmethod
    def post_stop(self, done: Done, mode: StopMode = StopMode.CONFIGURED) -> None:
        """As `Link.post_stop`."""

    @abstractmethod
    def post_estop(self, done: Done) -> None:
        """As `Link.post_estop`."""

    @abstractmethod
    def withdraw(self, done: Done) -> None:
        """As `Link.withdraw`."""

    @abstractmethod
    def _result(self, post: Callable[[Done], None]) -> Answer:
        """Post, and wait for the answer; raises it if it is an error."""

    def listen(self, listener: Listener, happening: Happening) -> None:
        """As `Link.listen`; whoever takes what comes calls it."""
        self._listener = listener
        standing = self._session.standing_news(happening)
        if standing is not None:
            listener(standing)

    def _tell_listener(self) -> None:
        news = self._session.news
        while news:
            happened = news.popleft()
            if self._listener is not None:
                self._listener(happened)

    def _check_alive(self) -> None:
        if self._end is not None:
            raise self._end.with_traceback(None)


class InlineLink(PostedLink):
    """A link whose callers do what the port's thread does for a `Link`."""

    @property
    def info(self) -> LinkInfo:
        """The name and the device."""
        return LinkInfo(self.name, None, None, self._device, self._session.board)

    @property
    @abstractmethod
    def now_us(self) -> int:
        """The time of the link."""

    def wait_for(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass until `ready()`, or for `timeout_s`; returns whether it was ready."""
        end_us = self.now_us + round(timeout_s * 1e6)
        while not ready():
            if self.now_us >= end_us:
                return False
            self._pass()
        return True

    def _pass(self) -> None:
        """Let time pass until something may have changed."""
        self.advance(STEP_S)

    def _clock_us(self) -> int:
        return self.now_us

    def _result(self, post: Callable[[Done], None]) -> Answer:
        results: list[Answer | WheelwireError] = []
        done = results.append
        post(done)
        if not self.wait_for(lambda: bool(results), ANSWER_S):
            self.withdraw(done)
            raise RequestTimeout(f"{self.name} does not answer")
        if isinstance(results[0], WheelwireError):
            raise results[0].with_traceback(None)
        return results[0]
