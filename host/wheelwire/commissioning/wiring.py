"""The wiring of both wheels, deduced from one pulse of each bridge and what a person saw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

from .motion import SIDES
from .problems import (
    BOTH_TURNED,
    CHANNEL_DEAD,
    CHANNELS_MIXED,
    NO_ENCODER,
    SAME_ENCODER,
    SHARED_COUNTER,
    UNSEEN,
    Problem,
)
from .pulses import Pulsed
from .questions import BOTH, NONE


@dataclass(frozen=True)
class Wiring:
    """How motors and encoders are wired to the pins; `left_` is of the left wheel.

    Attributes:
        motors_swapped: The left bridge has the right wheel's motor.
        encoders_swapped: The left counter has the right wheel's encoder.
        left_motor_reversed: Its motor turns backward at a forward duty.
        right_motor_reversed: The same on the right.
        left_encoder_reversed: Its encoder counts down when the wheel turns forward.
        right_encoder_reversed: The same on the right.
    """

    motors_swapped: bool = False
    encoders_swapped: bool = False
    left_motor_reversed: bool = False
    right_motor_reversed: bool = False
    left_encoder_reversed: bool = False
    right_encoder_reversed: bool = False

    @classmethod
    def of_corrections(cls, values: Mapping[str, float]) -> Wiring:
        """The wiring that these parameters correct."""
        # A wire is reversed, and a parameter inverts it: otherwise the names are the same.
        return cls(
            **{f.name: bool(values[f.name.replace("reversed", "inverted")]) for f in fields(cls)}
        )

    @property
    def corrections(self) -> dict[str, float]:
        """The parameters that correct it."""
        return {
            name.replace("reversed", "inverted"): float(wired)
            for name, wired in asdict(self).items()
        }


@dataclass(frozen=True)
class Seen:
    """One bridge was pulsed forward.

    Attributes:
        pulsed: What the counters did.
        answer: `left forward` and the like, `none` or `both`.
    """

    pulsed: Pulsed
    answer: str

    @property
    def wheel(self) -> int | None:
        """The one that turned; None for none and both."""
        return None if self.answer in (NONE, BOTH) else SIDES.index(self.answer.split()[0])

    @property
    def is_backward(self) -> bool:
        """The way in which it turned."""
        return self.answer.endswith("backward")

    @property
    def counters(self) -> list[int]:
        """Those that counted."""
        return [side for side in (0, 1) if self.pulsed.counted(side)]


def find_problems(first: Seen, second: Seen) -> list[Problem]:
    """Problems that make the wiring ambiguous."""
    # A defect that concerns both wheels is returned alone: it explains what else was seen.
    seen = (first, second)
    if any(one.answer == BOTH for one in seen):
        return [Problem(BOTH_TURNED)]
    for one in seen:
        if one.wheel is not None and len(one.counters) == 2:
            return [Problem(SAME_ENCODER, one.wheel)]
    found = []
    for one in seen:
        toggled = [side for side in (0, 1) if one.pulsed.toggled(side)]
        if one.wheel is None:
            if one.pulsed.was_noticed:
                found.append(Problem(UNSEEN))
        elif not one.counters and len(toggled) == 2:
            return [Problem(CHANNELS_MIXED)]
        elif not one.counters:
            found.append(Problem(CHANNEL_DEAD if toggled else NO_ENCODER, one.wheel))
    if not found and first.counters and first.counters == second.counters:
        return [Problem(SHARED_COUNTER)]
    return found


def deduce(first: Seen, second: Seen) -> Wiring:
    """The wiring, from pulses of the left and of the right bridge without any active correction.

    Each must have turned one wheel and moved one counter: no problems were found.
    """
    wheels = [one.wheel for one in (first, second)]
    # Pulses come by bridge, corrections are by wheel.
    by_wheel = (first, second) if wheels[0] == 0 else (second, first)
    motors = [one.is_backward for one in by_wheel]
    counters = [one.counters[0] for one in by_wheel]
    # Counting up while the wheel turns forward, or down while it turns backward, is right.
    encoders = [
        (one.pulsed.ticks[counter] < 0) != one.is_backward
        for one, counter in zip(by_wheel, counters, strict=True)
    ]
    return Wiring(wheels[0] == 1, counters[0] == 1, *motors, *encoders)
