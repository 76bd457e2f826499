"""Waiters: each of them is woken, whatever the others do."""

from __future__ import annotations

import select
from typing import Any, cast

from wheelwire.link.threads import Notifier, WakeUp

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


def test_a_waiter_that_waits_again_is_not_woken_in_place_of_another() -> None:
    notifier = Notifier()
    waiting = cast("set[Any]", notifier.waiting)
    waiters = [Eager(waiting) for _ in range(WAITERS)]
    waiting.update(waiters)
    notifier.notify_all()
    assert [waiter.woken for waiter in waiters] == [1] * WAITERS


def test_a_wake_up_never_waits_and_lasts_until_it_is_drained() -> None:
    wake_up = WakeUp()
    assert not is_readable(wake_up)
    wake_up.drain()
    for _ in range(100_000):  # far more than a socket's buffer holds
        wake_up.wake()
    while is_readable(wake_up):
        wake_up.drain()
    wake_up.wake()
    assert is_readable(wake_up)
    wake_up.close()
    wake_up.close()
    wake_up.wake()


def is_readable(wake_up: WakeUp) -> bool:
    return bool(select.select([wake_up], [], [], 0)[0])
