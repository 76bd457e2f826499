"""From a terminal's bytes to keys, and from keys to what they ask for. Sans-IO.

There are two encodings: the usual one, without releases, and that of the kitty keyboard protocol
(https://sw.kovidgoyal.net/kitty/keyboard-protocol/), with releases. Sequences may be split
anywhere. A space is always its own key, even in the middle of a sequence: it stops the robot.

A terminal repeats a held key after a delay of 0.25 to 0.66 s, then some 30 times a second, and
most terminals do not report its release. So each press and each repeat counts for a limited time. A
release, if one is reported, ends the press at once. Even then no press lasts without repeats: a
release may be lost with the connection or the window's focus.
"""

from __future__ import annotations

import enum
import math
from typing import NamedTuple, TypeAlias

UP, DOWN, LEFT, RIGHT = "up", "down", "left", "right"
SPACE = " "
INTERRUPT = "interrupt"
"""Ctrl with C, D, Z or backslash."""

MAX_SEQUENCE = 32
"""Longer ones are dropped: no key has one."""

FIRST_LIFE_S = 0.7
"""Life of a press: longer than the keyboard's delay before it repeats a held key."""
REPEAT_LIFE_S = 0.2
"""Life of a press after a repeat."""

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
"""Direction of each key: forward and to the left, each 1 or -1."""

_ESC = 0x1B
_SPACE = 0x20
_DELETE = 0x7F
_FIRST_FINAL = 0x40
_ARROWS = {"A": UP, "B": DOWN, "C": RIGHT, "D": LEFT}
_INTERRUPTING = {0x03, 0x04, 0x1A, 0x1C}
_CTRL = 4
_IGNORED_MODIFIERS = 0b111110
"""Alt, ctrl, super, hyper, meta; not shift, caps lock or num lock."""


class Action(enum.Enum):
    """What happened to a key."""

    TYPED = "typed"
    """Pressed or repeated: the terminal does not say which, and reports no release."""
    PRESSED = "pressed"
    REPEATED = "repeated"
    RELEASED = "released"


class KeyEvent(NamedTuple):
    """A key: a lower-case character, or one of the names above."""

    key: str
    action: Action


class KeyboardFlags(NamedTuple):
    """The terminal's answer to a query: the enhancements of the kitty protocol that are on."""

    flags: int


Event: TypeAlias = KeyEvent | KeyboardFlags


class KeyDecoder:
    """Decodes what a terminal sends, in any portions."""

    def __init__(self) -> None:
        self._sequence = bytearray()
        """A sequence that began with ESC, as far as it has come."""

    def feed(self, data: bytes) -> list[Event]:
        """Take bytes; returns the keys that they complete."""
        return list(filter(None, map(self._step, data)))

    def _step(self, byte: int) -> Event | None:
        sequence = self._sequence
        if byte == _ESC:  # also ends an unfinished sequence
            sequence[:] = bytes([byte])
            return None
        if not sequence:
            return _plain(byte)
        # No sequence contains these: it was the escape key alone, or the rest was lost.
        if byte <= _SPACE or byte >= _DELETE:
            sequence.clear()
            return _plain(byte)
        sequence.append(byte)
        if not _is_complete(sequence):
            return None
        text = sequence[1:].decode("ascii")
        sequence.clear()
        # SS3: an arrow of a terminal in application mode.
        if text[0] == "O":
            return _typed(_ARROWS.get(text[1]))
        # Anything else than CSI is a key after the escape key, or with alt.
        return _control_sequence(text[1:]) if text[0] == "[" else _plain(byte)


def _is_complete(sequence: bytearray) -> bool:
    """Whether the sequence ends with its last byte, which is a printing character."""
    if len(sequence) == 2:
        return sequence[1:2] != b"[" and sequence[1:2] != b"O"
    if sequence[1:] == b"[[":  # a function key of the Linux console has one character more
        return False
    return (
        sequence[1:3] == b"[["
        or sequence[1:2] == b"O"
        or sequence[-1] >= _FIRST_FINAL
        or len(sequence) >= MAX_SEQUENCE
    )


def _plain(byte: int) -> KeyEvent | None:
    if byte in _INTERRUPTING:
        return KeyEvent(INTERRUPT, Action.TYPED)
    return _typed(chr(byte).lower()) if _SPACE <= byte < _DELETE else None


def _typed(key: str | None) -> KeyEvent | None:
    return KeyEvent(key, Action.TYPED) if key else None


def _control_sequence(text: str) -> Event | None:
    """What follows CSI: parameters and a final character."""
    parameters, final = text[:-1], text[-1]
    try:
        if parameters.startswith("?"):
            return KeyboardFlags(int(parameters[1:])) if final == "u" else None
        if final not in _ARROWS and final != "u":
            return None
        # CODE[:...] ; MODIFIERS[:ACTION] [; ...], each of which may be left out
        fields = [field.split(":") for field in parameters.split(";")]
        code = int(fields[0][0] or 1)
        state = fields[1] if len(fields) > 1 else [""]
        modifiers = int(state[0] or 1) - 1
        action = int(state[1] or 1) if len(state) > 1 else None
    except ValueError:
        return None
    # Codes beyond ASCII are of other characters and of function keys.
    if code > _DELETE:
        return None
    if final == "u":
        if action is None:
            action = 1  # this encoding says so only of repeats and releases
        if modifiers & _CTRL and chr(code) in "cdz\\":
            return KeyEvent(INTERRUPT, _action(action))
        key = chr(code).lower() if _SPACE <= code < _DELETE else None
    else:
        key = _ARROWS[final]
    # With alt or ctrl it is another key. But a space always stops, and a release always ends its
    # press, whatever else is held.
    if key is None or (
        modifiers & _IGNORED_MODIFIERS and key != SPACE and _action(action) is not Action.RELEASED
    ):
        return None
    return KeyEvent(key, _action(action))


def _action(code: int | None) -> Action:
    if code is None:
        return Action.TYPED
    return {2: Action.REPEATED, 3: Action.RELEASED}.get(code, Action.PRESSED)


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
                # Only the newest of several held keys is repeated: it speaks for all of them.
                self._renew_all(now + FIRST_LIFE_S)

    def clear(self) -> None:
        """Let go of all keys; those still held must be pressed again."""
        self._ends.clear()

    def motion(self, now: float) -> Motion:
        """What the pressed keys ask for; `STILL` without any."""
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
