"""What every device counts, asked for with and without waiting."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import GroupUnavailable
from wheelwire.link.requests import RequestMessage
from wheelwire_protocol.codec import schema_hash
from wheelwire_protocol.codes import Group
from wheelwire_protocol.types import GroupGet, GroupInfo, MemoryGet, MemoryValue


def test_control_counters_are_asked_for_with_and_without_waiting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with MockDriver() as driver:
        assert driver.control_counters().latest_step_us > 0
        post = driver._link.post

        def post_and_wait(message: RequestMessage, done: Callable[[Any], None]) -> None:
            answered = threading.Event()

            def keep(answer: Any) -> None:
                done(answer)
                answered.set()

            post(message, keep)
            assert answered.wait(30)

        monkeypatch.setattr(driver._link, "post", post_and_wait)
        # Even when the answer comes while it asks, it is the next call's.
        assert driver.latest_control_counters() is None
        assert driver.latest_control_counters() is not None
    assert driver.latest_control_counters() is not None


def test_only_a_chip_tells_how_much_memory_is_left() -> None:
    with MockDriver(realtime=False) as robot:
        for _ in range(2):
            assert robot.latest_memory() is None
            robot.advance(0.1)
        with pytest.raises(GroupUnavailable, match="platform"):
            robot.memory()


def test_the_memory_of_a_chip_is_asked_for_with_and_without_waiting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    left = MemoryValue(0, 0, 90_000, 80_000, 5000, 1800, 0)
    with MockDriver(realtime=False) as robot:
        post = robot._link.post

        def post_to_a_chip(message: RequestMessage, done: Callable[[Any], None]) -> None:
            if isinstance(message, MemoryGet):
                done(left)
            elif isinstance(message, GroupGet) and message.group == Group.PLATFORM:
                done(GroupInfo(0, 0, Group.PLATFORM, schema_hash(Group.PLATFORM)))
            else:
                post(message, done)

        monkeypatch.setattr(robot._link, "post", post_to_a_chip)
        assert robot.memory() == left
        assert robot.latest_memory() is None
        assert robot.latest_memory() == left
