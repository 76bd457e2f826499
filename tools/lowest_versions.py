"""Print the lowest version of each dependency that pyproject.toml allows: `make lowest`."""

from __future__ import annotations

import sys
from pathlib import Path

from packaging.markers import Marker
from packaging.requirements import Requirement

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

EXTRAS = ("tools", "record", "view", "pi")
"""The packages that users install; not ROS's, whose releases have names."""


def lowest(line: str) -> str | None:
    """The requirement at its lower bound; None if this Python does not need it."""
    requirement = Requirement(line)
    if requirement.marker is not None and not Marker(str(requirement.marker)).evaluate():
        return None
    bounds = [bound.version for bound in requirement.specifier if bound.operator == ">="]
    if len(bounds) != 1:
        raise ValueError(f"{line}: say one lower bound (NAME>=VERSION) in pyproject.toml")
    return f"{requirement.name}=={bounds[0]}"


def main() -> None:
    """Print them in one line, as pip takes them."""
    project = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    lines = [*project["dependencies"], *(line for name in EXTRAS for line in extras[name])]
    print(*filter(None, map(lowest, lines)))


if __name__ == "__main__":
    main()
