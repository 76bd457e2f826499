"""What is wrong with a line, as a file of settings says it.

seed: 7                 # of all chance; the same seed gives the same faults

to_device:              # and to_host: the fields of `Faults`
  corrupt: 0.01

incidents:              # any number; the fields of `Incident`
  - {what: unplug, at_s: 5.0, for_s: 0.5, every_s: 20.0}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from wheelwire.errors import ConfigurationError

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
