"""Looks at a made-up robot, for a view's model."""

from __future__ import annotations

import math

from wheelwire.samples import Setpoint, WheelSample
from wheelwire.tools.view.model import Look
from wheelwire_protocol.codes import Fault, SupervisorState

LOOK_S = 0.05
DRIVING = SupervisorState.DRIVING


def sample(
    now_s: float,
    mps: float = 0.2,
    *,
    state: SupervisorState = DRIVING,
    faults: Fault = Fault(0),  # noqa: B008 - immutable
    boot_id: int = 1,
    battery_v: float | None = 12.1,
) -> WheelSample:
    """Both wheels at `mps`."""
    ticks = round(now_s * 1000)
    return WheelSample(
        boot_id=boot_id,
        t_us=round(now_s * 1e6),
        left_ticks=ticks,
        right_ticks=ticks,
        left_mps=mps,
        right_mps=mps,
        left_duty=mps * 2,
        right_duty=mps * 2,
        command_seq=1,
        state=state,
        faults=faults,
        overruns=0,
        battery_v=battery_v,
        stamp=now_s,
        stamp_error_s=0.0001,
    )


def look(now_s: float, mps: float = 0.2, **of_sample: object) -> Look:
    """A look at a robot in reach."""
    asked = Setpoint(mps, mps, duty=False) if mps else None
    return Look(now_s, sample(now_s, mps, **of_sample), asked, "")  # type: ignore[arg-type]


def wave(seconds: float, begin_s: float = 0.0) -> list[Look]:
    """A robot that drives back and forth, looked at for so long."""
    times = [begin_s + index * LOOK_S for index in range(round(seconds / LOOK_S))]
    return [look(now_s, 0.3 * math.sin(now_s)) for now_s in times]
