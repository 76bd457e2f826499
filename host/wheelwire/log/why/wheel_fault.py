"""What a wheel did before its fault: a dead encoder, a blocked wheel, or a motor without current.

Driven on, a dead encoder's count ends at full speed, and the motor turns on: the supply sags as
before. A blocked wheel's motor draws its stall current: the supply sags many times as much. A motor
whose wire is off draws none: the wheel rolls out, and the supply recovers.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from wheelwire_protocol.codes import SupervisorState

from ...link.sample_stream import DUTY_SCALE, Measurement
from ...samples import tick_difference
from .history import battery_v, drives

FAST_US = 15_000
"""Samples no farther apart than this show how a count ended."""
DRIVEN_S = 0.15
"""The supply at the end is the median over this time."""
ROLLED_OUT = 0.5
"""Fraction of the speed before; a wheel that still counted had slowed down below it."""
ROLLS_OUT_S = 0.6
"""A wheel without drive stands sooner."""
SPEEDS_UP_S = 0.5
"""Time that a wheel takes from rest to its speed: until then it draws more."""
LAST_TICKS = 3
"""The speed of the last ticks is taken over so many."""
STILL_ROLLS = 0.9
"""A wheel without drive has less than this part of its speed DRIVEN_S later."""
SLOW_TICKS_S = 150.0
"""Below this rate a count ends too soon to show how. [1/s]"""
TURNING = 20
"""Samples that show the supply of a wheel that turns."""
OSCILLATION = 6
"""This many changes of a count without progress mean one dead channel."""
NOISE_V = 0.006
"""A smaller sag shows nothing."""
DRIVEN_DUTY = 0.05
"""With less a wheel may stand."""
OTHER_TICKS = 2
"""A wheel that stands may rattle by so many."""
STALL_RATIO = 3.0
"""A stalled motor makes the supply sag this many times as much as one that turns on, or more."""
NO_CURRENT_RATIO = 0.15
"""A motor without current makes it sag by less than this part of that."""
STALL_V = 0.1
"""A sag that only a stalled motor explains, where none was seen before."""


class Finding(NamedTuple):
    """Causes that are left, and the evidence."""

    causes: tuple[str, ...]
    evidence: tuple[str, ...]


class _Point(NamedTuple):
    t_s: float
    ticks: int
    duty: float
    other_ticks: int
    """Ticks of the other wheel."""
    other_duty: float
    volts: float | None


def examine(samples: Sequence[Measurement], side: str, *, counting: bool) -> Finding:
    """What the samples of a drive say about a wheel that was found at fault.

    Args:
        samples: Up to the fault.
        side: "left" or "right".
        counting: Its fault is that it was driven harder than its count explains.
    """
    driven = _driven(samples)
    points = [_point(one, side) for one in driven]
    changes = [
        (later.t_s, tick_difference(later.ticks, earlier.ticks))
        for earlier, later in pairwise(points)
        if later.ticks != earlier.ticks
    ]
    if not points:
        return Finding(("encoder_dead", "wheel_blocked"), ("no sample of the drive before it",))
    duty = f"driven at {abs(points[-1].duty):.0%}"
    if not changes:
        return Finding(
            ("wheel_never_counted",), (f"{duty}, and not one tick since the drive began",)
        )
    if _oscillates(changes):
        text = f"the count's last {OSCILLATION} changes cancelled out"
        return Finding(("encoder_one_channel",), (duty, text))
    last_s = changes[-1][0]
    evidence = [duty]
    by_supply = _by_supply(samples, points, last_s, evidence)
    if counting:
        return _implausible(points, changes, by_supply, evidence)
    evidence[0] = f"{duty}; the last tick came {(points[-1].t_s - last_s) * 1000:.0f} ms before"
    evidence += _other_wheel(points, last_s, "right" if side == "left" else "left")
    if by_supply is not None:
        return Finding((by_supply,), tuple(evidence))
    return _by_speed(points, changes, evidence)


def _other_wheel(points: Sequence[_Point], last_s: float, name: str) -> tuple[str, ...]:
    """Whether the other wheel went on, if it was driven since this one's last tick."""
    since = [one for one in points if one.t_s >= last_s]
    if _median_other(since) < DRIVEN_DUTY:
        return ()
    turned = abs(tick_difference(since[-1].other_ticks, since[0].other_ticks))
    if turned > OTHER_TICKS:
        return (f"the {name} wheel went on",)
    return (f"the {name} wheel stopped counting, too: what do both share?",)


def _implausible(
    points: Sequence[_Point],
    changes: Sequence[tuple[float, int]],
    by_supply: str | None,
    evidence: list[str],
) -> Finding:
    """A wheel that was driven harder than its count explains, and counted on."""
    evidence.append("the ticks went on")
    end_s = points[-1].t_s
    earlier = _speed(changes, end_s - 2 * DRIVEN_S, end_s - DRIVEN_S)
    if _speed(changes, end_s - DRIVEN_S, end_s) >= STILL_ROLLS * earlier:
        # Any drive counts: a counter that misses edges misses more with more drive, too.
        return Finding(("encoder_implausible",), tuple(evidence))
    evidence.append("and became slower and slower while it was driven harder")
    # A count that misses edges by chance may fall once, and hardly twice on end.
    before = _speed(changes, end_s - 3 * DRIVEN_S, end_s - 2 * DRIVEN_S)
    if by_supply == "motor_open" and earlier < before:
        return Finding(("motor_open",), tuple(evidence))
    return Finding(("encoder_implausible", "motor_open"), tuple(evidence))


def _by_speed(
    points: Sequence[_Point], changes: Sequence[tuple[float, int]], evidence: list[str]
) -> Finding:
    """The finding by how the count ended, if the supply says nothing more."""
    last_s = changes[-1][0]
    period_s = median(later.t_s - earlier.t_s for earlier, later in pairwise(points))
    if period_s * 1e6 > FAST_US:
        evidence.append(f"a sample each {period_s * 1000:.0f} ms does not show how it ended")
        return Finding(("encoder_dead", "wheel_blocked", "motor_open"), tuple(evidence))
    full = _speed(changes, last_s - ROLLS_OUT_S - 0.2, last_s - ROLLS_OUT_S)
    if not full:
        full = _speed(changes, points[0].t_s, last_s)
    begin_s = changes[-LAST_TICKS - 1][0] if len(changes) > LAST_TICKS else points[0].t_s
    end = _speed(changes, begin_s, last_s)
    if end < ROLLED_OUT * full:
        evidence.append(f"it slowed down to {end / full:.0%} before its last tick")
        return Finding(("motor_open", "wheel_blocked"), tuple(evidence))
    evidence.append("it counted at full speed up to its last tick")
    # Held fast within less than two samples it looks the same, and the supply shows nothing.
    if full >= SLOW_TICKS_S:
        return Finding(("encoder_dead", "wheel_blocked"), tuple(evidence))
    evidence.append("which an undriven wheel may do at this speed, too")
    return Finding(("encoder_dead", "wheel_blocked", "motor_open"), tuple(evidence))


def _driven(samples: Sequence[Measurement]) -> list[Measurement]:
    """The newest samples in which the robot drove without a break."""
    found: list[Measurement] = []
    for one in reversed(samples):
        if one.supervisor is SupervisorState.DRIVING:
            found.append(one)
        elif found:
            break
    return found[::-1]


def _point(measurement: Measurement, side: str) -> _Point:
    state = measurement.state
    left = state.left_ticks, state.left_duty_q15 / DUTY_SCALE
    right = state.right_ticks, state.right_duty_q15 / DUTY_SCALE
    own, other = (left, right) if side == "left" else (right, left)
    return _Point(measurement.t_us / 1e6, *own, *other, battery_v(measurement))


def _oscillates(changes: Sequence[tuple[float, int]]) -> bool:
    """Up and down by single ticks, to nowhere."""
    steps = [step for _, step in changes[-OSCILLATION:]]
    # Several: a wheel that is held fast may rattle, too.
    return len(steps) == OSCILLATION and abs(sum(steps)) <= 2 and max(map(abs, steps)) <= 2


def _speed(changes: Sequence[tuple[float, int]], begin_s: float, end_s: float) -> float:
    return sum(abs(step) for at_s, step in changes if begin_s < at_s <= end_s) / (end_s - begin_s)


def _by_supply(
    samples: Sequence[Measurement], points: Sequence[_Point], last_s: float, evidence: list[str]
) -> str | None:
    """The cause, by how far the supply sagged while the wheel turned, and at the end.

    At a steady speed a motor's current only overcomes friction, so its load on the supply is in
    proportion to its duty. None: the supply is not measured, or shows too little.
    """
    rest = [volts for one in samples if not drives(one) and (volts := battery_v(one)) is not None]
    # At a steady speed, and before it could have rolled out, if it drove that long.
    turned = [one for one in points if one.t_s < last_s]
    begins = samples[0].t_us / 1e6 < points[0].t_s  # else it drove before
    speeds_up_s = SPEEDS_UP_S if begins else 0.0
    steady = [one for one in turned if one.t_s >= points[0].t_s + speeds_up_s] or turned
    before = ([one for one in steady if one.t_s <= last_s - ROLLS_OUT_S] or steady)[-TURNING:]
    end = [one for one in points if one.t_s >= points[-1].t_s - DRIVEN_S]
    turning_v, end_v = _median_v(before), _median_v(end)
    if turning_v is None or end_v is None:
        return None
    rest_v = max(rest, default=max(turning_v, end_v))
    sag_v, earlier_v = rest_v - end_v, rest_v - turning_v
    duty = median(abs(one.duty) for one in before)
    if not duty:
        return None
    text = (
        f"the supply sagged by {sag_v * 1000:.0f} mV at the end, and by {earlier_v * 1000:.0f} mV "
        "while it turned"
    )
    volts_per_duty = earlier_v / (duty + _median_other(before))
    explained_v = volts_per_duty * median(abs(one.duty) for one in end)
    if explained_v < NOISE_V and sag_v < STALL_V:
        return None
    evidence.append(text)
    own_v = sag_v - volts_per_duty * _median_other(end)
    if own_v >= STALL_RATIO * explained_v:
        return "wheel_blocked"
    return "motor_open" if own_v < NO_CURRENT_RATIO * explained_v else "encoder_dead"


def _median_v(points: Sequence[_Point]) -> float | None:
    volts = [one.volts for one in points if one.volts is not None]
    return median(volts) if volts else None


def _median_other(points: Sequence[_Point]) -> float:
    return median(abs(one.other_duty) for one in points)
