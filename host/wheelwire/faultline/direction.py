"""One direction of a bad line: bytes in, other bytes out, later. Sans-IO and seeded."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, replace
from random import Random

from wheelwire_protocol.decoder import Decoder

from .profile import Faults

BUFFER = 4096
"""Of a line with a baud rate: the usual size of a kernel's."""
_PIECE = re.compile(rb"\0?[^\0]+\0?|\0")


@dataclass
class Books:
    """What a direction was given, and what it did to it: the truth that counters are held to.

    A frame is never lost that is not `hit`: each has delimiters of its own. One that is hit may get
    through when all that it lost is a delimiter, sent by itself: its neighbour's serves as well.
    """

    frames: int = 0
    """Good frames given to the line."""
    hit: int = 0
    """Of these, lost or changed by at least one byte."""
    missing: int = 0
    """Already missing when given to the line, by their sequence numbers."""
    repeated: int = 0
    reordered: int = 0
    overrun: int = 0
    """Pieces lost because the buffer was full; they count as hit too."""


class Direction:
    """Bytes from one end to the other.

    Args:
        faults: What happens to them at first.
        random: Of all chance.
    """

    def __init__(self, faults: Faults, random: Random) -> None:
        self.faults = replace(faults)
        self.books = Books()
        self._random = random
        self._given = Decoder()
        self._frame_hit = False
        self._stalled = False
        self._held = b""
        self._overtaken: list[bytes] = []
        self._under_way: deque[tuple[int, bytes]] = deque()
        self._waiting = 0
        self._last_us = 0
        self._noise_us: int | None = None
        self._cut_next = False

    def send(self, data: bytes, now_us: int) -> None:
        """Give bytes to the line."""
        if self._stalled:
            self._held += data
            return
        for piece in _PIECE.findall(data):
            self._spoil(piece, now_us)

    def take(self, now_us: int) -> list[bytes]:
        """What has arrived, in pieces that are to be handed on one after the other."""
        self._babble(now_us)
        arrived = []
        while self._under_way and self._under_way[0][0] <= now_us:
            piece = self._under_way.popleft()[1]
            self._waiting -= len(piece)
            arrived += [bytes([byte]) for byte in piece] if self.faults.split else [piece]
        return arrived

    @property
    def next_us(self) -> int | None:
        """When something arrives; None while nothing is under way."""
        return self._under_way[0][0] if self._under_way else None

    def stall(self) -> None:
        """Let nothing more in; it waits for `resume`."""
        self._stalled = True

    def resume(self, now_us: int) -> None:
        """Let in what waited."""
        self._stalled = False
        held, self._held = self._held, b""
        self.send(held, now_us)

    def clear(self) -> None:
        """Lose all that is under way."""
        self._under_way.clear()
        self._overtaken.clear()
        self._waiting = 0
        self._held = b""

    def cut_next(self) -> None:
        """Let the next piece end in its middle."""
        self._cut_next = True

    @property
    def cut_pending(self) -> bool:
        """`cut_next` was asked for, and no piece has come since."""
        return self._cut_next

    def _spoil(self, piece: bytes, now_us: int) -> None:
        out = self._damaged(piece)
        overrun = self.faults.baud > 0 and self._waiting + len(out) > BUFFER
        if overrun:
            self.books.overrun += 1
            out = b""
        self._enter(piece, hit=out != piece)
        copies = 1 + (self._random.random() < self.faults.repeat)
        self.books.repeated += copies - 1
        if self._random.random() < self.faults.reorder:
            self.books.reordered += 1
            self._overtaken += [out] * copies
            return
        for waiting in [out] * copies + self._overtaken:
            self._carry(waiting, now_us)
        self._overtaken.clear()

    def _damaged(self, piece: bytes) -> bytes:
        faults, random = self.faults, self._random
        if self._cut_next:
            self._cut_next = False
            return piece[: len(piece) // 2]
        if random.random() < faults.loss:
            return b""
        out = bytearray(piece)
        if random.random() < faults.flip:
            out[random.randrange(len(out))] ^= 1 << random.randrange(8)
        if faults.corrupt:
            for index in range(len(out)):
                if random.random() < faults.corrupt:
                    out[index] ^= random.randrange(1, 256)
        return bytes(out)

    def _enter(self, piece: bytes, *, hit: bool) -> None:
        """Into the books; a frame may have come in several pieces."""
        self._frame_hit = self._frame_hit or hit
        completed = len(self._given.feed(piece))
        self.books.missing = self._given.counters.seq_lost
        if completed:
            self.books.frames += completed
            self.books.hit += self._frame_hit
            self._frame_hit = False

    def _carry(self, piece: bytes, now_us: int) -> None:
        if not piece:
            return
        faults = self.faults
        start_us = now_us + faults.delay_us
        if faults.jitter_us:
            start_us += round(self._random.random() ** 3 * faults.jitter_us)
        wire_us = round(len(piece) * 10e6 / faults.baud) if faults.baud else 0
        self._last_us = max(self._last_us, start_us) + wire_us
        self._waiting += len(piece)
        self._under_way.append((self._last_us, piece))

    def _babble(self, now_us: int) -> None:
        since_us = now_us if self._noise_us is None else self._noise_us
        count = int((now_us - since_us) * self.faults.noise_bytes_per_s / 1e6)
        if count or self._noise_us is None:
            self._noise_us = now_us
        if count and not self._stalled:
            self._carry(self._random.randbytes(min(count, BUFFER)), now_us)
