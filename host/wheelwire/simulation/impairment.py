"""What is wrong with a line, as a file of settings says it.

seed: 7                 # of all chance; the same seed gives the same faults

to_device:              # and to_host: the fields of `Faults`
  corrupt: 0.01

incidents:              # any number; the fields of `Incident`
  - {what: unplug, at_s: 5.0, for_s: 0.5, every_s: 20.0}
"""

from __future__ import annotations

import enum
import re
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from heapq import heapify, heappop, heappush
from pathlib import Path
from random import Random
from typing import Any

from wheelwire.errors import ConfigurationError
from wheelwire_protocol.decoder import Decoder

SHIPPED = Path(__file__).parent / "profiles"
KINDS = ("stall", "unplug", "reset")
_CHANCES = ("loss", "repeat", "reorder", "flip", "corrupt")


@dataclass
class Faults:
    """What happens on the way in one direction, now: it may be changed. Chances are from 0 to 1.

    A piece is what one write carries, cut behind each frame: a whole frame, as a rule.
    """

    loss: float = 0.0
    """Of a piece, whole."""
    repeat: float = 0.0
    """Of a piece: it comes twice."""
    reorder: float = 0.0
    """Of a piece: it changes places with the next one."""
    flip: float = 0.0
    """Of a piece: one of its bits is flipped."""
    corrupt: float = 0.0
    """Of each byte: it becomes another one."""
    noise_bytes_per_s: float = 0.0
    """Random bytes between the pieces: a line that babbles."""
    split: bool = False
    """Bytes come one by one."""
    baud: int = 0
    """10 bits a byte; what the buffer of 4096 bytes does not hold is lost. 0: no limit."""
    delay_us: int = 0
    """At least so long on the way; the order is kept."""
    jitter_us: int = 0
    """Up to so much longer, mostly much less."""

    def __post_init__(self) -> None:
        for name in _CHANCES:
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigurationError(f"{name} = {getattr(self, name)}: a chance is 0 to 1")
        for name in ("noise_bytes_per_s", "baud", "delay_us", "jitter_us"):
            if not 0 <= getattr(self, name) < 1e9:
                raise ConfigurationError(f"{name} = {getattr(self, name)}: must be 0 to 1e9")


@dataclass(frozen=True)
class Incident:
    """Something that happens to the line at a time.

    Attributes:
        at_s: After the line was made.
        what: `stall` (nothing passes, nothing is lost), `unplug` (the port is gone, what is under
            way is lost) or `reset` (of the device, in the middle of a frame to the host).
        for_s: How long a stall or an unplugging lasts.
        every_s: Again and again, so long after the last begin; 0: once.
    """

    at_s: float
    what: str
    for_s: float = 0.0
    every_s: float = 0.0

    def __post_init__(self) -> None:
        if self.what not in KINDS:
            raise ConfigurationError(f"incident {self.what!r}: there are {', '.join(KINDS)}")
        if min(self.at_s, self.for_s, self.every_s) < 0:
            raise ConfigurationError(f"incident {self.what!r}: times are not below 0")
        if 0 < self.every_s <= self.for_s:
            raise ConfigurationError(f"incident {self.what!r}: every_s must be above for_s")


@dataclass(frozen=True)
class LineProfile:
    """A line, both ways, and what happens to it."""

    to_device: Faults = field(default_factory=Faults)
    to_host: Faults = field(default_factory=Faults)
    incidents: tuple[Incident, ...] = ()
    seed: int = 1


def shipped_profiles() -> list[str]:
    """Names that `load_profile` knows without a file."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def load_profile(name: str) -> LineProfile:
    """Read a profile: a file's path, or the name of a shipped one.

    Raises:
        ConfigurationError: There is no such file, or it says something that cannot be.
    """
    shipped = SHIPPED / f"{name}.yaml"
    import yaml

    path = shipped if name in shipped_profiles() else Path(name)
    try:
        return parse_profile(yaml.safe_load(path.read_text("utf-8")))
    except OSError as error:
        known = ", ".join(shipped_profiles())
        raise ConfigurationError(
            f"no profile {name}: {error.strerror}; shipped ones are {known}"
        ) from error
    except (UnicodeDecodeError, yaml.YAMLError, ConfigurationError) as error:
        raise ConfigurationError(f"{path}: {error}") from error


def parse_profile(settings: object) -> LineProfile:
    """The profile that a file's content describes.

    Raises:
        ConfigurationError: It says something that cannot be.
    """
    if not isinstance(settings, dict):
        raise ConfigurationError("a profile is a list of names and values, such as `seed: 7`")
    _check_names("the profile", settings, {"seed", "to_device", "to_host", "incidents"})
    incidents = settings.get("incidents", [])
    if not isinstance(incidents, list):
        raise ConfigurationError("incidents: write one a line, each behind a dash")
    return LineProfile(
        to_device=_filled(Faults, settings.get("to_device", {})),
        to_host=_filled(Faults, settings.get("to_host", {})),
        incidents=tuple(_filled(Incident, incident) for incident in incidents),
        seed=settings.get("seed", 1),
    )


def _filled(kind: type[Any], values: Any) -> Any:
    if not isinstance(values, dict):
        raise ConfigurationError(f"{kind.__name__}: {values!r} is no list of names and values")
    _check_names(kind.__name__, values, {f.name for f in fields(kind)})
    try:
        return kind(**values)
    except TypeError as error:
        raise ConfigurationError(f"{kind.__name__}: {error}") from error


def _check_names(where: str, given: Mapping[str, Any], known: set[str]) -> None:
    for name in given:
        if name not in known:
            raise ConfigurationError(
                f"{where} has no {name!r}; there are {', '.join(sorted(known))}"
            )


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


CUT_PATIENCE_US = 100_000
"""A device that is to be reset in the middle of a frame, but sends none, is reset after this."""


class Happening(enum.Enum):
    """What the line's owner has to do, since it has the ports and the device."""

    UNPLUG = enum.auto()
    PLUG = enum.auto()
    RESET = enum.auto()


class FaultLine:
    """The line between a host and a device.

    Args:
        profile: What is wrong with it.
        now_us: Any clock that does not go back; `at_s` counts from here.
    """

    def __init__(self, profile: LineProfile, now_us: int = 0) -> None:
        self.to_device = Direction(profile.to_device, Random(profile.seed))
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

    def advance(self, now_us: int) -> list[Happening]:
        """Do what is due; returns what is left to the owner, in order."""
        happenings = [*self._begin_due(now_us)]
        if _is_due(self._stalled_until_us, now_us):
            self._stalled_until_us = None
            self.to_device.resume(now_us)
            self.to_host.resume(now_us)
        if _is_due(self._unplugged_until_us, now_us):
            self._unplugged_until_us = None
            happenings.append(Happening.PLUG)
        if _is_due(self._reset_by_us, now_us) or self._was_cut:
            self._reset_by_us = None
            happenings.append(Happening.RESET)
        return happenings

    @property
    def next_us(self) -> int | None:
        """When there is something to do; None while nothing is under way or planned."""
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
        """Lose all that is under way: the port is gone."""
        self.to_device.clear()
        self.to_host.clear()

    @property
    def _was_cut(self) -> bool:
        return self._reset_by_us is not None and not self.to_host.cut_pending

    def _begin_due(self, now_us: int) -> Iterator[Happening]:
        while self._script and self._script[0][0] <= now_us:
            due_us, number, incident = heappop(self._script)
            if incident.every_s:
                heappush(self._script, (due_us + round(incident.every_s * 1e6), number, incident))
            until_us = now_us + round(incident.for_s * 1e6)
            if incident.what == "stall":
                self._stalled_until_us = until_us
                self.to_device.stall()
                self.to_host.stall()
            elif incident.what == "unplug":
                self._unplugged_until_us = until_us
                self.clear()
                yield Happening.UNPLUG
            else:
                self._reset_by_us = now_us + CUT_PATIENCE_US
                self.to_host.cut_next()


def _is_due(moment_us: int | None, now_us: int) -> bool:
    return moment_us is not None and moment_us <= now_us
