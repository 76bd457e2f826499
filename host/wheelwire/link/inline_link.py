"""A link without a port, whose callers let its time pass."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

from ..errors import RequestTimeout, WheelwireError, afresh
from .device_link import DeviceLink
from .info import LinkInfo
from .requests import Answer, Done

STEP_S = 0.001
"""By how much time passes between two looks."""
ANSWER_S = 5.0


class InlineLink(DeviceLink):
    """A link whose callers do what the port's thread does for a `Link`."""

    @property
    def info(self) -> LinkInfo:
        """The name and the device."""
        session = self._session
        return LinkInfo(self.name, None, None, self._device, session.board, session.copies_lost)

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
            self._pass(end_us - self.now_us)
        return True

    def _pass(self, most_us: int) -> None:  # noqa: ARG002 - it looks more often
        """Let time pass until something may have changed, at most so long."""
        self.advance(STEP_S)

    def clock_us(self) -> int:
        """As `now_us`."""
        return self.now_us

    def _result(self, post: Callable[[Done], None], *, is_stop: bool = True) -> Answer | None:  # noqa: ARG002 - nothing can interrupt it
        results: list[Answer | WheelwireError] = []
        done = results.append
        post(done)
        if not self.wait_for(lambda: bool(results), ANSWER_S):
            self.withdraw(done)
            raise RequestTimeout(f"{self.name} does not answer; is it unplugged?")
        if isinstance(results[0], WheelwireError):
            raise afresh(results[0])
        return results[0]
