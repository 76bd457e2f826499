"""Installs the requirements of one extra of pyproject.toml, and others, into this Python.

Usage: tools/install_extra.py EXTRA [REQUIREMENT...]. The REQUIREMENTs are installed without their
own requirements. One that cannot be installed is named, in one line.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import requires

from pip._vendor.packaging.requirements import Requirement

PIP = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check"]


def wanted(extra: str) -> list[str]:
    """The requirements of the extra that apply to this Python."""
    known = [Requirement(text) for text in requires("wheelwire") or []]
    return [
        f"{requirement.name}{requirement.specifier}"
        for requirement in known
        if requirement.marker
        and requirement.marker.evaluate({"extra": extra})
        and not requirement.marker.evaluate({"extra": ""})
    ]


def install(requirements: Sequence[str], *options: str) -> str:
    """Returns the names of what is not available, if any."""
    if not requirements:
        return ""
    command = [*PIP, *options, *requirements]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode == 0:
        return ""
    blamed = re.search(r"No matching distribution found for ([\w.-]+)", result.stderr)
    return blamed[1] if blamed else ", ".join(requirements)


def main(extra: str, *alone: str) -> int:
    """Install the extra's requirements, then the others alone."""
    missing = install(wanted(extra)) or install(alone, "--no-deps")
    if missing:
        sys.stderr.write(f"make {extra} needs {missing}, which pip cannot install here\n")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
