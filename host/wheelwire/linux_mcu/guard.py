"""Watches the core's process and pulls EN low if it dies or hangs while it holds the pins.

A killed process leaves its outputs as they were: with EN high the wheels would not stop turning.
"""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Callable

from ..errors import WheelwireError
from .heartbeat import Heartbeat, Phase

CHECK_S = 0.01


def watch(
    core_pid: int,
    heartbeat: Heartbeat,
    core_timeout_s: float,
    prepare_enable_low: Callable[[], Callable[[], None]],
) -> int:
    """Wait until the core's process has ended, by itself or killed by the guard.

    Args:
        core_pid: A child of this process.
        heartbeat: Shared with the core.
        core_timeout_s: A running core that is silent for longer is killed; only then can the guard
            claim its pins.
        prepare_enable_low: Does the slow part in advance; the function it returns pulls EN low.

    Returns:
        The exit status of the core's process.
    """
    # A pidfd, because waitpid has no time-out: the heartbeat has to be looked at meanwhile.
    core = os.pidfd_open(core_pid)
    enable_low = _prepared(prepare_enable_low, heartbeat)
    while not _ended(core):
        if heartbeat.phase is Phase.RUNNING and heartbeat.age_s > core_timeout_s:
            # If the guard itself was not scheduled for a while, neither was the core: give it one
            # check's time to beat again before it is killed.
            if _ended(core, wait_s=CHECK_S) or heartbeat.age_s <= core_timeout_s:
                continue
            os.kill(core_pid, signal.SIGKILL)
    # Reaped only here: until then its pid cannot become another process's, which would be killed.
    _, status = os.waitpid(core_pid, 0)
    # A core that closed its pins has pulled EN low itself, and another program may own them now.
    if heartbeat.phase in (Phase.RUNNING, Phase.SAVING):
        enable_low()
    os.close(core)
    return os.waitstatus_to_exitcode(status)


def _prepared(
    prepare_enable_low: Callable[[], Callable[[], None]], heartbeat: Heartbeat
) -> Callable[[], None]:
    try:
        enable_low = prepare_enable_low()
    except WheelwireError:  # the core runs into the same error and reports it
        return lambda: None
    heartbeat.guard_is_ready()
    return enable_low


def _ended(core: int, wait_s: float = CHECK_S) -> bool:
    return bool(select.select([core], [], [], wait_s)[0])
