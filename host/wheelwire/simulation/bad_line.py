"""An impaired serial line; `files.bad_line` reads one from YAML."""

from __future__ import annotations

import enum
import re
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from heapq import heapify, heappop, heappush
from random import Random

from wheelwire_protocol.decoder import Decoder

from ..errors import ConfigurationError, shown

KINDS = ("stall", "unplug", "reset")
_CHANCES = ("loss", "repeat", "reorder", "flip", "corrupt")


def _check_number(
    name: str, value: object, high: float, expected: str, *, whole: bool = False
) -> None:
    # A bool is an int, and YAML makes a bool of `yes`. NaN is refused by the comparison.
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not 0 <= value <= high or (whole and value != int(value)):  # type: ignore[operator,call-overload]
        raise ConfigurationError(f"{name} = {shown(value)}: it must be {expected}")


@dataclass
class Impairment:
    """What one direction does to the bytes; may be changed at any time. Probabilities are 0 to 1.

    A piece is what one write carries, split after each frame: usually a whole frame.
    """

    loss: float = 0.0
    """Probability that a piece is lost."""
    repeat: float = 0.0
    """Probability that a piece arrives twice."""
    reorder: float = 0.0
    """Probability that a piece swaps places with the next one."""
    flip: float = 0.0
    """Probability that one bit of a piece is flipped."""
    corrupt: float = 0.0
    """Probability, per byte, that it is replaced by another one."""
    noise_bytes_per_s: float = 0.0
    """Random bytes between the pieces."""
    split: bool = False
    """Bytes arrive one by one."""
    baud_rate: int = 0
    """10 bits a byte; what does not fit the buffer of 4096 bytes is lost. 0: no limit."""
    delay_us: int = 0
    """Minimum delay; the order stays the same."""
    jitter_us: int = 0
    """Maximum additional delay; usually much less."""

    def __post_init__(self) -> None:
        for name in _CHANCES:
            _check_number(name, getattr(self, name), 1, "a probability, 0 to 1")
        _check_number("noise_bytes_per_s", self.noise_bytes_per_s, 1e9, "a number, 0 to 1e9")
        for name in ("baud_rate", "delay_us", "jitter_us"):
            value = getattr(self, name)
            _check_number(name, value, 1e9, "a whole number, 0 to 1e9", whole=True)
        if not isinstance(self.split, bool):
            raise ConfigurationError(f"split = {shown(self.split)}: it must be true or false")


@dataclass(frozen=True)
class Incident:
    """Something that happens to the line at a given time.

    Attributes:
        at_s: Seconds after the line was created.
        what: `stall` (nothing passes, nothing is lost), `unplug` (the port is gone, bytes in
            flight are lost) or `reset` (of the device, in the middle of a frame to the host).
        for_s: Duration of a stall or an unplugging.
        every_s: Period at which it repeats, from start to start; 0: once.
    """

    at_s: float
    what: str
    for_s: float = 0.0
    every_s: float = 0.0

    def __post_init__(self) -> None:
        if self.what not in KINDS:
            raise ConfigurationError(f"what = {shown(self.what)}: choose from {', '.join(KINDS)}")
        for name in ("at_s", "for_s", "every_s"):
            _check_number(name, getattr(self, name), 1e9, "seconds, 0 to 1e9")
        if 0 < self.every_s <= self.for_s:
            raise ConfigurationError(
                f"every_s = {self.every_s:g}: it must be greater than for_s = {self.for_s:g}"
            )


@dataclass(frozen=True)
class LineProfile:
    """Both directions of a line, and the incidents on it."""

    to_device: Impairment = field(default_factory=Impairment)
    to_host: Impairment = field(default_factory=Impairment)
    incidents: tuple[Incident, ...] = ()
    seed: int = 1


BUFFER = 4096
"""Bytes that a line with a baud rate buffers: the usual size of a kernel's buffer."""
# A frame with its delimiters, as far as the write contains them, or a delimiter alone.
_PIECE = re.compile(rb"\0?[^\0]+\0?|\0")


@dataclass
class GroundTruth:
    """What one direction was given and did to it; receivers' counters are checked against it.

    A frame that is not `hit` is never lost, for each has its own delimiters. One that is hit may
    still arrive if all it lost is a delimiter: the neighbouring frame's delimiter serves as well.
    """

    frames: int = 0
    """Good frames given to the line."""
    hit: int = 0
    """Good frames that the line lost or changed in at least one byte."""
    missing: int = 0
    """Already missing when given to the line, by their sequence numbers."""
    repeated: int = 0
    reordered: int = 0
    overrun: int = 0
    """Pieces lost because the buffer was full; they count as hit too."""


class Direction:
    """Bytes from one end to the other.

    Args:
        impairment: Copied; `self.impairment` may be changed later.
        random: Source of all randomness.
    """

    def __init__(self, impairment: Impairment, random: Random) -> None:
        self.impairment = replace(impairment)
        self.truth = GroundTruth()
        self.cut_pending = False
        """Whether the next piece is truncated in the middle; then False again."""
        self._random = random
        # A piece may be a part of a frame: only a decoder knows where good frames end.
        self._sent = Decoder()
        self._frame_hit = False
        self._stalled = False
        self._held = b""
        self._overtaken: list[bytes] = []
        self._in_flight: deque[tuple[int, bytes]] = deque()
        self._waiting = 0
        self._last_us = 0
        self._noise_us: int | None = None

    def send(self, data: bytes, now_us: int) -> None:
        """Give bytes to the line."""
        if self._stalled:
            self._held += data
            return
        for piece in _PIECE.findall(data):
            self._impair(piece, now_us)

    def take(self, now_us: int) -> list[bytes]:
        """Return what has arrived, in pieces that are to be forwarded one by one."""
        self._add_noise(now_us)
        arrived = []
        while self._in_flight and self._in_flight[0][0] <= now_us:
            piece = self._in_flight.popleft()[1]
            self._waiting -= len(piece)
            arrived += [bytes([byte]) for byte in piece] if self.impairment.split else [piece]
        return arrived

    @property
    def next_us(self) -> int | None:
        """When the next piece arrives; None while none is in flight."""
        return self._in_flight[0][0] if self._in_flight else None

    def stall(self) -> None:
        """Hold back everything that is sent, until `resume`."""
        self._stalled = True

    def resume(self, now_us: int) -> None:
        """Send what was held back."""
        self._stalled = False
        held, self._held = self._held, b""
        self.send(held, now_us)

    def clear(self) -> None:
        """Lose everything in flight."""
        self._in_flight.clear()
        self._overtaken.clear()
        self._waiting = 0
        self._held = b""

    def _impair(self, piece: bytes, now_us: int) -> None:
        out = self._damaged(piece)
        overrun = self.impairment.baud_rate > 0 and self._waiting + len(out) > BUFFER
        if overrun:  # like a kernel's buffer when the writer is faster than the line
            self.truth.overrun += 1
            out = b""
        self._enter(piece, hit=out != piece)
        copies = 1 + (self._random.random() < self.impairment.repeat)
        self.truth.repeated += copies - 1
        if self._random.random() < self.impairment.reorder:
            self.truth.reordered += 1
            self._overtaken += [out] * copies
            return
        # A piece to be reordered waits until the next one has been carried.
        for waiting in [out] * copies + self._overtaken:
            self._carry(waiting, now_us)
        self._overtaken.clear()

    def _damaged(self, piece: bytes) -> bytes:
        impairment, random = self.impairment, self._random
        if self.cut_pending:
            self.cut_pending = False
            return piece[: len(piece) // 2]
        if random.random() < impairment.loss:
            return b""
        out = bytearray(piece)
        if random.random() < impairment.flip:
            out[random.randrange(len(out))] ^= 1 << random.randrange(8)
        if impairment.corrupt:
            for index in range(len(out)):
                if random.random() < impairment.corrupt:
                    out[index] ^= random.randrange(1, 256)  # never 0: the byte really changes
        return bytes(out)

    def _enter(self, piece: bytes, *, hit: bool) -> None:
        """Record a piece in the ground truth; a frame may come in several pieces."""
        self._frame_hit = self._frame_hit or hit
        # What was given is decoded, not what arrives: this counts the frames that could be lost.
        completed = len(self._sent.feed(piece))
        self.truth.missing = self._sent.counters.seq_lost
        if completed:
            self.truth.frames += completed
            self.truth.hit += self._frame_hit
            self._frame_hit = False

    def _carry(self, piece: bytes, now_us: int) -> None:
        if not piece:
            return
        impairment = self.impairment
        start_us = now_us + impairment.delay_us
        if impairment.jitter_us:
            # The cube makes long delays rare.
            start_us += round(self._random.random() ** 3 * impairment.jitter_us)
        wire_us = round(len(piece) * 10e6 / impairment.baud_rate) if impairment.baud_rate else 0
        # Never before the previous piece: a serial line keeps the order.
        self._last_us = max(self._last_us, start_us) + wire_us
        self._waiting += len(piece)
        self._in_flight.append((self._last_us, piece))

    def _add_noise(self, now_us: int) -> None:
        since_us = now_us if self._noise_us is None else self._noise_us
        count = int((now_us - since_us) * self.impairment.noise_bytes_per_s / 1e6)
        # The time is used up only by whole bytes, or frequent calls would round all noise away.
        if count or self._noise_us is None:
            self._noise_us = now_us
        if count and not self._stalled:
            self._carry(self._random.randbytes(min(count, BUFFER)), now_us)


CUT_TIMEOUT_US = 100_000
"""A device that is to be reset in the middle of a frame but sends none is reset after this."""


class LineEvent(enum.Enum):
    """What the line's owner has to do: it holds the ports and the device."""

    UNPLUG = enum.auto()
    PLUG = enum.auto()
    RESET = enum.auto()


class ImpairedLine:
    """The line between a host and a device.

    Args:
        profile: Its impairment and incidents.
        now_us: The time by any monotonic clock; `at_s` counts from here.
    """

    def __init__(self, profile: LineProfile, now_us: int = 0) -> None:
        self.to_device = Direction(profile.to_device, Random(profile.seed))
        # Separate generators, so that a change on one side does not change the other side's run.
        self.to_host = Direction(profile.to_host, Random(profile.seed + 1))
        # The number keeps incidents of the same time in the profile's order.
        self._script = [
            (now_us + round(incident.at_s * 1e6), number, incident)
            for number, incident in enumerate(profile.incidents)
        ]
        heapify(self._script)
        self._stalled_until_us: int | None = None
        self._unplugged_until_us: int | None = None
        self._reset_by_us: int | None = None

    def advance(self, now_us: int) -> list[LineEvent]:
        """Do what is due; return the events that the owner has to carry out, in order."""
        # First what begins: an incident without a duration also ends in this call.
        events = [*self._begin_due(now_us)]
        if _is_due(self._stalled_until_us, now_us):
            self._stalled_until_us = None
            self.to_device.resume(now_us)
            self.to_host.resume(now_us)
        if _is_due(self._unplugged_until_us, now_us):
            self._unplugged_until_us = None
            events.append(LineEvent.PLUG)
        was_cut = self._reset_by_us is not None and not self.to_host.cut_pending
        if was_cut or _is_due(self._reset_by_us, now_us):
            self._reset_by_us = None
            events.append(LineEvent.RESET)
        return events

    @property
    def next_us(self) -> int | None:
        """When `advance` is due next; None while nothing is in flight or scheduled."""
        moments = (
            self.to_device.next_us,
            self.to_host.next_us,
            self._script[0][0] if self._script else None,
            self._stalled_until_us,
            self._unplugged_until_us,
            self._reset_by_us,
        )
        return min((moment for moment in moments if moment is not None), default=None)

    def clear(self) -> None:
        """Lose everything in flight: the port is gone."""
        self.to_device.clear()
        self.to_host.clear()

    def _begin_due(self, now_us: int) -> Iterator[LineEvent]:
        while self._script and self._script[0][0] <= now_us:
            due_us, number, incident = heappop(self._script)
            # Counted from when it was due: a late call must not shift those that follow.
            if incident.every_s:
                heappush(self._script, (due_us + round(incident.every_s * 1e6), number, incident))
            # From now: one that begins late lasts as long.
            until_us = now_us + round(incident.for_s * 1e6)
            if incident.what == "stall":
                self._stalled_until_us = until_us
                self.to_device.stall()
                self.to_host.stall()
            elif incident.what == "unplug":
                self._unplugged_until_us = until_us
                self.clear()
                yield LineEvent.UNPLUG
            else:
                # A real reset hits the UART in the middle of a byte stream: cut the next frame
                # first, then reset.
                self._reset_by_us = now_us + CUT_TIMEOUT_US
                self.to_host.cut_pending = True


def _is_due(moment_us: int | None, now_us: int) -> bool:
    return moment_us is not None and moment_us <= now_us
