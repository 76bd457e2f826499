"""Runs every benchmark and collects their output in build/bench/report.md: `make bench`."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import TextIO

from harness import FOLDER, ROOT

BENCHES = (
    *("codec", "capture", "imports", "link", "latency", "aio", "ros"),
    *("reflexes", "drivers", "recording", "view"),
)
"""The benchmarks, in the order of the report."""
SCRIPTS = tuple(Path(__file__).with_name(f"{bench}.py") for bench in BENCHES)
CPU_INFO = Path("/proc/cpuinfo")


def machine() -> str:
    """The heading: the computer that the figures were measured on."""
    found = re.search(r"model name\s*: (.+)", CPU_INFO.read_text()) if CPU_INFO.exists() else None
    processor = found[1] if found else platform.processor() or platform.machine()
    name = f"{processor}, {os.cpu_count()} cores"
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    described = subprocess.run(command, capture_output=True, text=True, check=False)
    facts = {
        "processor": name,
        "system": platform.platform(),
        "Python": platform.python_version(),
        "wheelwire": described.stdout.strip() or version("wheelwire"),
        "load at the start": " ".join(f"{load:.2f}" for load in os.getloadavg()),
        "packages": ", ".join(f"{name} {version(name)}" for name in ("numpy", "pyserial", "typer")),
    }
    lines = "".join(f"- {name}: {fact}\n" for name, fact in facts.items())
    return f"# Benchmarks of {name}\n\n{lines}\n"


def run(script: Path, report: TextIO) -> int:
    """Run one benchmark and forward its output; returns its exit code."""
    # Each in a process of its own: none inherits the memory, threads and imports of another.
    command = [sys.executable, str(script)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            _write(line, report)
    if process.returncode:
        _write(f"**{script.stem} failed with exit code {process.returncode}.**\n\n", report)
    return process.returncode


def _write(text: str, report: TextIO) -> None:
    for file in (sys.stdout, report):
        file.write(text)
        # A run that is interrupted leaves what it has found so far.
        file.flush()


def main() -> int:
    """Run all; returns 1 and prints the names if any failed."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (FOLDER / "report.md").open("w") as report:
        _write(machine(), report)
        failed = [script.stem for script in SCRIPTS if run(script, report)]
    if failed:
        sys.stderr.write(f"failed: {', '.join(failed)}\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
