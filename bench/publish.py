"""Copies the report of the last `make bench` into docs/benchmarks.md.

`python bench/publish.py`, after a run on a machine that has nothing else to do.
"""

from __future__ import annotations

import re

import mdformat

from harness import FOLDER, ROOT

PAGE = ROOT / "docs" / "benchmarks.md"
MARK = "<!-- From here on the report of one run, by bench/publish.py -->\n"


def published(page: str, report: str) -> str:
    """The page with its report replaced.

    Headings are one level deeper, and only the targets that were missed are shown.

    Args:
        page: The page's text; all behind `MARK` goes.
        report: What `make bench` wrote.

    Raises:
        ValueError: The page has no mark.
    """
    prose, mark, _ = page.partition(MARK)
    if not mark:
        raise ValueError(f"{PAGE} has no line {MARK!r}")
    text = re.sub(r"^(?=##? )", "#", report, flags=re.MULTILINE)
    text = re.sub(
        r"^(Reached, with the target: |\*\*\w+ failed ).*\n+", "", text, flags=re.MULTILINE
    )
    return f"{prose}{mark}\n{text.rstrip()}\n"


def main() -> None:
    """Write the page."""
    page = published(PAGE.read_text("utf-8"), (FOLDER / "report.md").read_text("utf-8"))
    options = {"wrap": 100, "compact_tables": True}  # as `make lint` wants it
    PAGE.write_text(mdformat.text(page, options=options, extensions={"gfm", "tables"}), "utf-8")


if __name__ == "__main__":
    main()
