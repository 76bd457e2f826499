"""A process that is late as rarely as this computer allows."""

from __future__ import annotations

import ctypes
import gc
import os

CORE_PRIORITY = 40
GUARD_PRIORITY = 41
"""It acts when the core does not let go of the processor."""
_MCL_CURRENT, _MCL_FUTURE = 1, 2


def become_punctual(priority: int) -> str | None:
    """Real-time priority and locked memory, as far as this is allowed.

    Returns:
        What was not allowed, in a sentence; None when nothing is lacking.
    """
    gc.collect()
    gc.freeze()  # the objects of the start need never be looked through again
    refused = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        refused.append("real-time priority (LimitRTPRIO)")
    if ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        refused.append("locked memory (LimitMEMLOCK)")
    if not refused:
        return None
    return f"not allowed: {' and '.join(refused)}; a busy computer makes the control loop late"
