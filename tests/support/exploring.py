"""The explorer: how it is run, and what it says."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .processes import captured

ROOT = Path(__file__).parents[2]
PROGRAM = ROOT / "build" / "host" / "wheelwire-explore"
FOLDER = ROOT / "build" / "explore"
CASES = ROOT / "tests" / "explore" / "cases"
PROCESSES = 2

Cells = dict[str, Counter[str]]
"""How often each cell of each table was seen."""


@dataclass
class Report:
    """What one or more runs came to.

    Attributes:
        broken: Each rule that was broken: code, name and what happened; the seed.
        files: The shortest scenarios that break them.
        cells: Tables of what was reached.
        totals: scenarios, robot seconds, cpu seconds.
    """

    broken: list[tuple[str, str]] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    cells: Cells = field(default_factory=lambda: defaultdict(Counter))
    totals: Counter[str] = field(default_factory=Counter)

    def add(self, output: str) -> None:
        """Take in what a process printed."""
        for line in output.splitlines():
            kind, first, last = line.split("\t")
            if kind == "broken":
                self.broken.append((first, last))
            elif kind == "file":
                self.files.append(Path(first))
            elif kind == "ran":
                self.totals[first] += float(last)  # type: ignore[assignment]
            else:
                self.cells[kind][first] += int(last)

    @property
    def hours_per_cpu_minute(self) -> float:
        """Hours of the robot's time in a minute of a processor."""
        cpu_s = self.totals["cpu seconds"]
        return self.totals["robot seconds"] / 60.0 / cpu_s if cpu_s else 0.0


def explore(
    first_seed: int,
    *,
    seconds: float = 0.0,
    count: int = 0,
    processes: int = PROCESSES,
    options: Sequence[str] = (),
) -> Report:
    """Carry out scenarios from consecutive seeds, until a rule is broken."""
    limit = ["--seconds", f"{seconds:g}"] if seconds else ["--count", str(count)]
    return _run(
        [
            ["--seed", str(first_seed + number), "--every", str(processes), *limit, *options]
            for number in range(processes)
        ]
    )


def exhaust(*, processes: int = PROCESSES) -> Report:
    """Visit every combination of the small spaces."""
    return _run([["--exhaustive", f"{number}/{processes}"] for number in range(processes)])


def _run(commands: Sequence[Sequence[str]]) -> Report:
    """Run the explorer with each of these options, side by side."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    running = []
    with tempfile.TemporaryDirectory() as folder:
        outputs = [Path(folder) / str(number) for number in range(len(commands))]
        try:
            for options, output in zip(commands, outputs, strict=True):
                command = [str(PROGRAM), *options, "--folder", str(FOLDER)]
                with output.open("w") as file:
                    running.append(subprocess.Popen(command, stdout=file))
            # Until all have ended, or one has found something.
            while None in (ends := [process.poll() for process in running]) and not any(ends):
                time.sleep(0.05)
        finally:
            for process in running:
                process.kill()
                process.wait()
        report = Report()
        for output in outputs:
            report.add(output.read_text("utf-8"))
    return report


def replay(*cases: Path) -> subprocess.CompletedProcess[str]:
    """Carry out scenarios that are written down."""
    return captured(PROGRAM, "--replay", *cases)
