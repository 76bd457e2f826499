"""Real-time scheduling, as far as this computer allows it."""

from __future__ import annotations

import ctypes
import gc
import os

CORE_PRIORITY = 40
GUARD_PRIORITY = 41
"""Above the core's: the guard must run even if the core hogs the processor."""
_MCL_CURRENT, _MCL_FUTURE = 1, 2


def request_realtime(priority: int) -> str | None:
    """Request real-time priority and locked memory for this process.

    Returns:
        What was not permitted, in a sentence; None if nothing was refused.
    """
    # Collected first, or the garbage of the start would stay for ever.
    gc.collect()
    gc.freeze()  # garbage collection need not scan the objects of the start again
    refused = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        refused.append("real-time priority (LimitRTPRIO)")
    # A page that has to be read back would hold up a step. Python itself has no mlockall.
    if ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        refused.append("locked memory (LimitMEMLOCK)")
    if not refused:
        return None
    return (
        f"not permitted: {' and '.join(refused)}; on a busy computer the control loop will run late"
    )
