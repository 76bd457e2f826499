"""Quadrature, x4: every edge of both channels counts, and an impossible change is counted apart."""

from __future__ import annotations

A, B = 2, 1
"""The channels' bits in a state."""

ILLEGAL = 2
_CYCLE = (0b00, 0b10, 0b11, 0b01)  # forward: A leads B


def _step(before: int, after: int) -> int:
    quarter_turns = (_CYCLE.index(after) - _CYCLE.index(before)) % 4
    return (0, 1, ILLEGAL, -1)[quarter_turns]


STEPS = tuple(_step(before, after) for before in range(4) for after in range(4))
"""Ticks from state `index >> 2` to state `index & 3`; ILLEGAL where both channels changed."""


class QuadratureDecoder:
    """One encoder. Fed by one thread; the counts may be read from any.

    Args:
        a: Level of channel A now.
        b: Level of channel B now.
    """

    def __init__(self, a: int, b: int) -> None:
        self.ticks = 0
        """Forward positive, without bounds."""
        self.illegal = 0
        """Changes that show that an edge was lost; the ticks lost with it are not known."""
        self._state = self._before = A * a | B * b
        self._stamp: int | float | None = None
        self._ticks_before = 0
        self._illegal_before = 0

    def change(self, channel: int, level: int, stamp: int | float) -> None:
        """`channel` (A or B) was seen to change to `level`.

        Changes with one stamp were seen in one sample: which came first is not known, so they are
        judged together.
        """
        if stamp != self._stamp:
            self._stamp = stamp
            self._before = self._state
            self._ticks_before = self.ticks
            self._illegal_before = self.illegal
        after = self._state | channel if level else self._state & ~channel
        if after == self._state:
            self.illegal += 1  # it changed twice, and one of the edges was not seen
            self._illegal_before += 1
            return
        self._state = after
        step = STEPS[self._before << 2 | after]
        if step == ILLEGAL:
            self.ticks = self._ticks_before
            self.illegal = self._illegal_before + 1
        else:
            self.ticks = self._ticks_before + step
            self.illegal = self._illegal_before
