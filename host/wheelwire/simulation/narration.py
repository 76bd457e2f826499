"""What a person next to the simulated robot would see its wheels do, in sentences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from .simulator import TrueState

SIDES = ("left", "right")
SEEN_TURNS = 0.005
"""A person does not see a smaller turn."""
REST_S = 0.4
"""A shorter standstill belongs to the same motion: setup pulses a motor several times."""


@dataclass
class _Wheel:
    forward: float = 0.0
    backward: float = 0.0

    def add(self, turns: float) -> None:
        self.forward += max(turns, 0.0)
        self.backward += max(-turns, 0.0)

    def said(self) -> str:
        """Which way the wheel turned, and how far; empty if it was too little to see."""
        ways = [
            f"{way} {turns:.2f} turns"
            for way, turns in (("forward", self.forward), ("backward", self.backward))
            if turns > SEEN_TURNS
        ]
        return " and ".join(ways)


@dataclass
class Narrator:
    """Says after each motion which wheel turned which way.

    Args:
        counts: Counts of an ideal encoder in a turn of a wheel.
        say: Called with a sentence, once the wheels stand.
    """

    counts: float
    say: Callable[[str], None]
    _before: tuple[int, int] = (0, 0)
    """The ticks by then. A wheel may turn before the first state comes."""
    _wheels: tuple[_Wheel, _Wheel] = field(default_factory=lambda: (_Wheel(), _Wheel()))
    _moved_us: int | None = None
    """When they last turned; None: there is nothing to say."""

    def watch(self, state: TrueState) -> None:
        """Take the next true state, some twenty a second."""
        (left, right), self._before = self._before, (state.left_ticks, state.right_ticks)
        ticks = state.left_ticks - left, state.right_ticks - right
        if ticks != (0, 0):
            self._moved_us = state.t_us
            for wheel, count in zip(self._wheels, ticks, strict=True):
                wheel.add(count / self.counts)
        elif self._moved_us is not None and state.t_us - self._moved_us >= REST_S * 1e6:
            said = self._sentence()
            self._moved_us, self._wheels = None, (_Wheel(), _Wheel())
            if said:
                self.say(said)

    def _sentence(self) -> str:
        left, right = (wheel.said() for wheel in self._wheels)
        if left and left == right:
            return f"both wheels turned {left}"
        parts = [
            f"the {side} wheel turned {said}"
            for side, said in zip(SIDES, (left, right), strict=True)
            if said
        ]
        return ", ".join(parts)
