"""Quadrature decoding, x4: every edge of both channels counts; impossible changes are counted."""

from __future__ import annotations

A, B = 2, 1
"""The bits of the channels in a state."""

ILLEGAL = 2
_CYCLE = (0b00, 0b10, 0b11, 0b01)  # forward: A leads B


def _step(before: int, after: int) -> int:
    quarter_turns = (_CYCLE.index(after) - _CYCLE.index(before)) % 4
    # Three quarters forward are one back; two may have been made either way.
    return (0, 1, ILLEGAL, -1)[quarter_turns]


STEPS = tuple(_step(before, after) for before in range(4) for after in range(4))
"""Ticks from state `index >> 2` to state `index & 3`; ILLEGAL where both channels changed."""


class QuadratureDecoder:
    """One encoder. Fed by one thread; any thread may read the counts.

    Args:
        a: Level of channel A now.
        b: Level of channel B now.
    """

    def __init__(self, a: int, b: int) -> None:
        self.ticks = 0
        """Forward positive, unbounded."""
        self.illegal = 0
        """Impossible changes: each shows that at least one edge was lost."""
        self._state = self._before = A * a | B * b
        self._stamp: int | float | None = None
        self._ticks_before = 0
        self._illegal_before = 0

    def change(self, channel: int, level: int, stamp: int | float) -> None:
        """Feed a change of `channel` (A or B) to `level`.

        Changes with the same stamp come from one sample. Their order is unknown, so they are
        decoded together.
        """
        if stamp != self._stamp:  # a new sample: count from the state before it
            self._stamp = stamp
            self._before = self._state
            self._ticks_before = self.ticks
            self._illegal_before = self.illegal
        after = self._state | channel if level else self._state & ~channel
        if after == self._state:
            self.illegal += 1  # it changed twice, and one of the edges was missed
            # In the count before the sample, too, or the sample's next change would take it back.
            self._illegal_before += 1
            return
        self._state = after
        step = STEPS[self._before << 2 | after]
        if step == ILLEGAL:
            # Both channels changed between two samples: the direction is unknown, so no tick.
            self.ticks = self._ticks_before
            self.illegal = self._illegal_before + 1
        else:
            # The step is 0 where the changes of the sample have cancelled each other.
            self.ticks = self._ticks_before + step
            self.illegal = self._illegal_before
