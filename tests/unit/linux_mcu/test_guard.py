"""The guard beside a process that stands in for the core's."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

import pytest

from wheelwire.linux_mcu import guard
from wheelwire.linux_mcu.guard import Heartbeat, Phase

CORE_TIMEOUT_S = 0.1


def watched(act: Callable[[Heartbeat], None]) -> tuple[int, list[str]]:
    """The exit status of a core that does `act`, and whether EN was pulled low after it."""
    heartbeat, low = Heartbeat(), list[str]()
    core_pid = os.fork()
    if core_pid == 0:
        heartbeat.phase = Phase.RUNNING
        act(heartbeat)
        heartbeat.phase = Phase.CLOSED
        os._exit(0)
    status = guard.watch(core_pid, heartbeat, CORE_TIMEOUT_S, lambda: lambda: low.append("EN"))
    return status, low


def saves_to_a_slow_card(heartbeat: Heartbeat) -> None:
    with heartbeat.saving():
        time.sleep(5 * CORE_TIMEOUT_S)


def hangs(_heartbeat: Heartbeat) -> None:
    signal.pause()


def dies_while_it_saves(heartbeat: Heartbeat) -> None:
    with heartbeat.saving():
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_slow_save_is_no_hang() -> None:
    assert watched(saves_to_a_slow_card) == (0, [])


@pytest.mark.parametrize("act", [hangs, dies_while_it_saves])
def test_a_core_that_is_gone_drives_no_more(act: Callable[[Heartbeat], None]) -> None:
    assert watched(act) == (-signal.SIGKILL, ["EN"])
