"""Which directions are pressed, and until when. Pure: the caller brings the time.

A terminal repeats a held key after a delay of 0.25 to 0.66 s, then some 30 times a second, and
most terminals do not report its release. So each press and each repeat lives for a while of its
own; a release, where there is one, ends the press at once. No press lives on without repeats, even
where releases are reported: a release may be lost with the connection or the window's focus.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .keys import DOWN, LEFT, RIGHT, UP, Action, KeyEvent

FIRST_LIFE_S = 0.7
"""How long a press lives: longer than the keyboard's delay before it repeats a held key."""
REPEAT_LIFE_S = 0.2
"""After a repeat."""

_FORWARD, _BACKWARD, _TO_LEFT, _TO_RIGHT = (1, 0), (-1, 0), (0, 1), (0, -1)
DIRECTIONS = {
    UP: _FORWARD,
    "w": _FORWARD,
    DOWN: _BACKWARD,
    "s": _BACKWARD,
    LEFT: _TO_LEFT,
    "a": _TO_LEFT,
    RIGHT: _TO_RIGHT,
    "d": _TO_RIGHT,
}
"""What each key asks for: forward and to the left, each 1 or -1."""


class Motion(NamedTuple):
    """What the keys ask for: -1, 0 or 1 each."""

    forward: int
    """Forward positive."""
    left: int
    """Counter-clockwise positive."""
    until: float
    """When the first of its presses ends. [s]"""


STILL = Motion(0, 0, math.inf)


class Presses:
    """The keys of `DIRECTIONS` that are pressed. Times are one clock's, in seconds."""

    def __init__(self) -> None:
        self._ends: dict[str, float] = {}

    def take(self, event: KeyEvent, now: float) -> None:
        """Take an event of one of the keys of `DIRECTIONS`."""
        key, action = event
        self._drop_ended(now)
        pressed = key in self._ends
        if action is Action.RELEASED:
            self._ends.pop(key, None)
        elif action is Action.REPEATED:
            if pressed:  # not of a key that was let go by `clear` while it was held
                self._renew_all(now + REPEAT_LIFE_S)
        elif action is Action.TYPED and pressed:
            # Where presses and repeats look alike, a key that comes again in time is repeated.
            self._renew(key, now + REPEAT_LIFE_S)
        else:
            self._drop_opposite(key)
            self._ends[key] = now + FIRST_LIFE_S
            if action is Action.PRESSED:
                # Of several held keys only the newest is repeated: it speaks for all of them.
                self._renew_all(now + FIRST_LIFE_S)

    def clear(self) -> None:
        """Let go of all keys; those still held have to be pressed anew."""
        self._ends.clear()

    def motion(self, now: float) -> Motion:
        """What the pressed keys ask for; `STILL` if there are none."""
        self._drop_ended(now)
        if not self._ends:
            return STILL
        directions = {DIRECTIONS[key] for key in self._ends}
        forward = sum(direction[0] for direction in directions)
        left = sum(direction[1] for direction in directions)
        return Motion(forward, left, min(self._ends.values()))

    def _drop_ended(self, now: float) -> None:
        self._ends = {key: end for key, end in self._ends.items() if end > now}

    def _drop_opposite(self, key: str) -> None:
        """The newest of two opposite directions counts."""
        forward, left = DIRECTIONS[key]
        opposite = (-forward, -left)
        self._ends = {k: end for k, end in self._ends.items() if DIRECTIONS[k] != opposite}

    def _renew(self, key: str, end: float) -> None:
        # The first repeat must not shorten the longer life of its press.
        self._ends[key] = max(self._ends[key], end)

    def _renew_all(self, end: float) -> None:
        for key in self._ends:
            self._renew(key, end)
