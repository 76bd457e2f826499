"""Waiters: each of them is woken, whatever the others do."""

from __future__ import annotations

from typing import Any, cast

from wheelwire.link.waiting import Notifier

WAITERS = 50


class Eager:
    """Waits again the moment it is woken, as a thread may."""

    def __init__(self, waiting: set[Any], depth: int = 1) -> None:
        self.woken = 0
        self._waiting = waiting
        self._depth = depth

    def release(self) -> None:
        self.woken += 1
        if self._depth:
            self._waiting.add(Eager(self._waiting, self._depth - 1))


def test_whoever_waits_again_is_not_woken_in_place_of_another() -> None:
    notifier = Notifier()
    waiting = cast("set[Any]", notifier._waiting)
    waiters = [Eager(waiting) for _ in range(WAITERS)]
    waiting.update(waiters)
    notifier.notify_all()
    assert [waiter.woken for waiter in waiters] == [1] * WAITERS
