"""The stops that attached programs ask for: one at a time for all of them, each caller answered.

A stop goes out at once if none is under way. Those that are asked for meanwhile wait for that one's
answer, and become a single further stop: it is sent after all of them were asked for.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TypeAlias

from ...errors import WheelwireError
from ...link.requests import Answer, Done

PERIOD_S = 0.02
"""Between two of them at the least: a flood must not fill the line, on which the owner drives."""

_Result: TypeAlias = "Answer | WheelwireError"


class AttachedStops:
    """Merges stops. One thread calls it; only `_answered` is another's, the link's.

    Args:
        post: Sends a stop, and has its argument called with the result.
        wake: Has the thread of this call `advance` soon.
    """

    def __init__(self, post: Callable[[Done], None], wake: Callable[[], None]) -> None:
        self._post = post
        self._wake = wake
        self._waiting: list[Done] = []
        self._under_way: list[Done] = []
        self._results: deque[_Result] = deque()
        self._next_s = 0.0

    def ask(self, done: Done) -> None:
        """Stop the robot, now or with the next stop; `done` is called with that one's result."""
        self._waiting.append(done)

    def due_s(self) -> float | None:
        """When `advance` has something to do; None while nobody waits to be sent."""
        return self._next_s if self._waiting and not self._under_way else None

    def advance(self, now_s: float) -> None:
        """Answer those whose stop was answered, and send the next stop if it is due."""
        while self._results:
            answered, self._under_way = self._under_way, []
            result = self._results.popleft()
            for done in answered:
                done(result)
        due_s = self.due_s()
        if due_s is None or now_s < due_s:
            return
        self._under_way, self._waiting = self._waiting, []
        self._next_s = now_s + PERIOD_S
        try:
            self._post(self._answered)
        except WheelwireError as error:
            self._results.append(error)
            self._wake()

    def _answered(self, result: _Result) -> None:
        self._results.append(result)
        self._wake()
