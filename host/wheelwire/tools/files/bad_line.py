"""A bad line in front of a simulated robot, as YAML.

seed: 7                 # of the random generators; a run repeats for its seed

to_device:              # and to_host: the fields of `Impairment`
  corrupt: 0.01

incidents:              # any number; the fields of `Incident`
  - {what: unplug, at_s: 5.0, for_s: 0.5, every_s: 20.0}
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TypeVar

from ...simulation.bad_line import Impairment, Incident, LineProfile
from .reading import Section, file_named, names_in, reading

SHIPPED = Path(__file__).parents[2] / "simulation" / "profiles"
MAX_SEED = 2**32 - 1

_Shape = TypeVar("_Shape")


def shipped_profiles() -> list[str]:
    """Names of the built-in profiles."""
    return names_in(SHIPPED)


def load_profile(name: str | Path) -> LineProfile:
    """Read a profile from a file, or a built-in one by its name.

    Raises:
        ConfigurationError: The file does not exist or is invalid.
    """
    with reading(file_named(name, SHIPPED, "profile"), "profile") as content:
        file = Section(content, [field.name for field in fields(LineProfile)])
        incidents = file.get("incidents", [])
        if not isinstance(incidents, list):
            raise file.refusal("incidents", "list one incident per line, each after a dash")
        return LineProfile(
            to_device=_filled(Impairment, file.get("to_device", {}), "to_device"),
            to_host=_filled(Impairment, file.get("to_host", {}), "to_host"),
            incidents=tuple(
                _filled(Incident, incident, f"incidents[{index}]")
                for index, incident in enumerate(incidents)
            ),
            seed=file.whole("seed", MAX_SEED, 1),
        )


def _filled(shape: type[_Shape], content: object, name: str) -> _Shape:
    known = [field.name for field in fields(shape)]  # type: ignore[arg-type]
    return Section(content, known, name).fill(shape)
