"""Watches the core's process, and pulls EN low when that dies or hangs with its pins claimed."""

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
    """Until the core's process has ended, by itself or by the guard.

    Args:
        core_pid: A child of this process.
        heartbeat: The core's.
        core_timeout_s: A running core that is silent for longer is killed: no pin can be claimed
            while it holds them.
        prepare_enable_low: Does what is slow; its result pulls EN low.

    Returns:
        The exit status of the core's process.
    """
    core = os.pidfd_open(core_pid)
    enable_low = _prepared(prepare_enable_low, heartbeat)
    while not _ended(core):
        if heartbeat.phase is Phase.RUNNING and heartbeat.age_s > core_timeout_s:
            # Where this process was held up itself, the core was so too, and has its chance now.
            if _ended(core, wait_s=CHECK_S) or heartbeat.age_s <= core_timeout_s:
                continue
            os.kill(core_pid, signal.SIGKILL)
    _, status = os.waitpid(core_pid, 0)
    if heartbeat.phase in (Phase.RUNNING, Phase.SAVING):
        enable_low()
    os.close(core)
    return os.waitstatus_to_exitcode(status)


def _prepared(
    prepare_enable_low: Callable[[], Callable[[], None]], heartbeat: Heartbeat
) -> Callable[[], None]:
    try:
        enable_low = prepare_enable_low()
    except WheelwireError:  # the core finds the same, and tells
        return lambda: None
    heartbeat.guard_is_ready()
    return enable_low


def _ended(core: int, wait_s: float = CHECK_S) -> bool:
    return bool(select.select([core], [], [], wait_s)[0])
