"""Runs every benchmark and collects their output in build/bench/report.md: `make bench`."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import TextIO

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import ROOT, output_folder

BENCHES = (
    *("codec", "capture", "imports"),
    *("link", "latency", "links_per_host", "sensor_line", "ros"),
    *("control", "reflexes", "sensor_faults", "battery"),
    *("drivers", "cost", "recording", "view"),
)
"""The benchmarks, in the order of the report."""

SCRIPTS = tuple(Path(__file__).with_name(f"{bench}.py") for bench in BENCHES)

CPU_INFO = Path("/proc/cpuinfo")


def machine() -> str:
    """The heading: the computer that the figures were measured on."""
    facts = {
        "processor": f"{_processor()}, {os.cpu_count()} cores",
        "system": platform.platform(),
        "Python": platform.python_version(),
        "wheelwire": _commit(),
        "load at the start": " ".join(f"{load:.2f}" for load in os.getloadavg()),
        "packages": ", ".join(_packages()),
    }
    lines = "".join(f"- {name}: {fact}\n" for name, fact in facts.items())
    return f"# Benchmarks of {_processor()}, {os.cpu_count()} cores\n\n{lines}\n"


def _processor() -> str:
    if CPU_INFO.exists():
        found = re.search(r"model name\s*: (.+)", CPU_INFO.read_text())
        if found:
            return found[1]
    return platform.processor() or platform.machine()


def _commit() -> str:
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    described = subprocess.run(command, capture_output=True, text=True, check=False)
    return described.stdout.strip() or version("wheelwire")


def _packages() -> list[str]:
    """Names and versions of the requirements of wheelwire and its extra `bench`."""
    found = []
    for requirement in requires("wheelwire") or ():
        name = re.split(r"[^\w.-]", requirement)[0]
        if "extra ==" in requirement and "extra == 'bench'" not in requirement:
            continue
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:  # not wanted on this platform
            continue
    return found


def run(script: Path, folder: Path, report: TextIO) -> int:
    """Run one benchmark and forward its output; returns its exit code."""
    # Each in a process of its own: none inherits the memory, threads and imports of another.
    command = [sys.executable, str(script), "--output", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            _write(line, report)
    if process.returncode:
        _write(f"\n**{script.stem} failed with exit code {process.returncode}.**\n", report)
    _write("\n", report)
    return process.returncode


def _write(text: str, report: TextIO) -> None:
    for file in (sys.stdout, report):
        file.write(text)
        # A run that is interrupted leaves what it has found so far.
        file.flush()


def main() -> int:
    """Run all; returns 1 and prints the names if any failed."""
    folder = output_folder(__doc__)
    with (folder / "report.md").open("w") as report:
        _write(machine(), report)
        failed = [script.stem for script in SCRIPTS if run(script, folder, report)]
    if failed:
        sys.stderr.write(f"failed: {', '.join(failed)}\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
