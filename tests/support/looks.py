"""Looks at a made-up robot, for a view's model."""

from __future__ import annotations

import math
from typing import Any

from wheelwire.samples import Setpoint, WheelSample
from wheelwire.tools.view.model import Look
from wheelwire_protocol.codes import SupervisorState

from . import host_samples

LOOK_S = 0.05
DRIVING = SupervisorState.DRIVING


def sample(now_s: float, mps: float = 0.2, **fields: Any) -> WheelSample:
    """Both wheels at `mps`."""
    ticks = round(now_s * 1000)
    driving: dict[str, Any] = {
        "t_us": round(now_s * 1e6),
        **dict.fromkeys(("left_ticks", "right_ticks"), ticks),
        **dict.fromkeys(("left_mps", "right_mps"), mps),
        **dict.fromkeys(("left_duty", "right_duty"), mps * 2),
        "command_seq": 1,
        "state": DRIVING,
        "battery_v": 12.1,
        "stamp": now_s,
        "stamp_error_s": 0.0001,
    }
    return host_samples.sample(**driving | fields)


def look(now_s: float, mps: float = 0.2, **of_sample: Any) -> Look:
    """A look at a robot in reach."""
    asked = Setpoint(mps, mps, duty=False) if mps else None
    return Look(now_s, sample(now_s, mps, **of_sample), asked, "")


def wave(seconds: float, begin_s: float = 0.0) -> list[Look]:
    """A robot that drives back and forth, looked at for so long."""
    times = [begin_s + index * LOOK_S for index in range(round(seconds / LOOK_S))]
    return [look(now_s, 0.3 * math.sin(now_s)) for now_s in times]
