"""What every benchmark shares: its command line, its section of the report, its targets.

A benchmark is a module with a `main(report, ...)`. Its docstring is the section: a title, and how
it is measured, with the module's constants in braces. The other parameters of `main` are the
command's options.
"""

from __future__ import annotations

import argparse
import inspect
import logging
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import ROOT, Target, spread, summary_of_targets, table

__all__ = ("FOLDER", "ROOT", "Report", "end_without_ros", "run", "spread", "three")
FOLDER = ROOT / "build" / "bench"


class Report:
    """Prints a benchmark's results as they are found.

    Attributes:
        folder: For files next to the report.
        scratch: For files that go when the benchmark ends.
    """

    def __init__(self, folder: Path, scratch: Path) -> None:
        self.folder = folder
        self.scratch = scratch
        self.targets: list[Target] = []

    def say(self, text: str) -> None:
        """A paragraph."""
        sys.stdout.write(f"{text}\n\n")
        sys.stdout.flush()

    def table(self, header: str, rows: Iterable[str]) -> None:
        """A table; cells are separated as in Markdown."""
        self.say(table(header.split(" | "), [row.split(" | ") for row in rows])[:-1])

    def items(self, rows: Iterable[str]) -> None:
        """A list; a row has a name and its figures, separated as in `table`."""
        cells = [[cell for cell in row.split(" | ") if cell.strip()] for row in rows]
        self.say("\n".join(f"- {name}: {', '.join(figures)}" for name, *figures in cells))

    def target(self, what: str, measured: object, limit: object, reached: bool) -> None:
        """Add a target; they end the section. The limit "" means no limit."""
        self.targets.append(Target(what, str(measured), str(limit), reached))

    def at_most(self, what: str, measured: float, limit: float, unit: str = "") -> None:
        """A target whose limit itself is reached."""
        number, bound = (f"{x:.3g}" if x < 1000 else f"{x:.0f}" for x in (measured, limit))
        self.target(what, f"{number}{unit}", f"<= {bound}{unit}", measured <= limit)

    def at_least(self, what: str, measured: float, limit: float, form: str) -> None:
        """A target whose limit itself is reached; both numbers have this format."""
        self.target(what, f"{measured:{form}}", f">= {limit:{form}}", measured >= limit)

    def equal(self, what: str, measured: float, wanted: float) -> None:
        """A target that is one number."""
        self.target(what, measured, wanted, measured == wanted)

    def end(self) -> int:
        """Print the targets; returns 1 if one was missed."""
        if self.targets:
            self.say(summary_of_targets(self.targets)[:-1])
        return int(not all(target.reached for target in self.targets))


def end_without_ros(title: str) -> None:
    """End the program, and say in its section that there is no ROS 2."""
    sys.stdout.write(f"## {title}\n\nNot measured: rclpy is not installed (`make ros`).\n\n")
    sys.exit()


def run(main: Callable[..., None], *, log_level: str = "NOTSET") -> None:
    """Run a benchmark as the program that it is, if its module is the program.

    Args:
        main: What it does.
        log_level: What the log says of, at least; a benchmark that loses links means each loss.
    """
    module = inspect.getmodule(main)
    if module is None or module.__name__ != "__main__":
        return
    title, _, method = inspect.cleandoc(module.__doc__ or "").partition("\n\n")
    parser = argparse.ArgumentParser(description=title)
    parser.add_argument("--output", type=Path, default=FOLDER, help="the folder for files")
    _, *options = inspect.signature(main, eval_str=True).parameters.values()
    for option in options:
        parser.add_argument(f"--{option.name}", type=option.annotation, default=option.default)
    given = vars(parser.parse_args())
    logging.getLogger("wheelwire").setLevel(log_level)
    with TemporaryDirectory() as scratch:
        report = Report(given.pop("output"), Path(scratch))
        report.folder.mkdir(parents=True, exist_ok=True)
        report.say(f"## {title.removesuffix('.')}")
        if method:
            report.say(method.format_map(vars(module)))
        # So that another program's latched e-stop does not hold a robot of this one.
        os.environ.setdefault("WHEELWIRE_RUNTIME_DIR", scratch)
        main(report, **given)
    sys.exit(report.end())


def three(values: Sequence[float], unit: str = "", digits: int = 1) -> str:
    """The median, the 99th percentile and the greatest."""
    return " / ".join(f"{value:.{digits}f}" for value in spread(values)) + unit
