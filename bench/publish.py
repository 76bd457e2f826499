"""Copies the report of the last `make bench` into docs/benchmarks.md, and its plots beside it.

`python bench/publish.py`, after a run on a machine that has nothing else to do.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import mdformat

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import ROOT

PAGE = ROOT / "docs" / "benchmarks.md"
MARK = "<!-- From here on the report of one run, by bench/publish.py -->\n"
PLOT = re.compile(r"(?<=\]\()[\w.-]+\.png(?=\))")
"""The target of an image."""


def published(page: str, report: str, plots: str) -> str:
    """The page with its report replaced; its headings are one level deeper.

    Args:
        page: The page's text; all behind `MARK` goes.
        report: What `make bench` wrote.
        plots: The folder of the plots, as the page sees it.

    Raises:
        ValueError: The page has no mark.
    """
    prose, mark, _ = page.partition(MARK)
    if not mark:
        raise ValueError(f"{PAGE} has no line {MARK!r}")
    deeper = re.sub(r"^(?=##? )", "#", report, flags=re.MULTILINE)
    placed = PLOT.sub(lambda plot: f"{plots}/{plot[0]}", deeper)
    return f"{prose}{mark}\n{placed.rstrip()}\n"


def main() -> None:
    """Write the page and copy the plots that it shows."""
    run = ROOT / "build" / "bench"
    report = (run / "report.md").read_text("utf-8")
    plots = PAGE.with_suffix("")
    plots.mkdir(exist_ok=True)  # docs/control.md has plots there, too
    for plot in PLOT.findall(report):
        shutil.copy(run / plot, plots)
    page = published(PAGE.read_text("utf-8"), report, plots.name)
    options = {"wrap": 100, "compact_tables": True}  # as `make lint` wants it
    PAGE.write_text(mdformat.text(page, options=options, extensions={"gfm", "tables"}), "utf-8")


if __name__ == "__main__":
    main()
