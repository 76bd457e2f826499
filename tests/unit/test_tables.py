"""Every Markdown table renders as a table."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from markdown_it import MarkdownIt

from support.cases import each

ROOT = Path(__file__).parents[2]
PAGES = subprocess.run(
    ["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True
).stdout.split()
PARSER = MarkdownIt("gfm-like", {"linkify": False})


def problems(text: str) -> list[str]:
    """Rows that no table holds, and those whose number of cells is not the header's."""
    found = []
    lines = text.splitlines()
    in_tables: set[int] = set()
    tokens = PARSER.parse(text)
    for token in tokens:
        if token.map and token.type in ("fence", "code_block", "html_block"):
            in_tables.update(range(*token.map))
        if token.map and token.type == "table_open":
            rows = range(*token.map)
            in_tables.update(rows)
            widths = [cells(lines[row]) for row in rows]
            found += [
                f"line {row + 1}: {width} cells, the header has {widths[0]}"
                for row, width in zip(rows, widths, strict=True)
                if width != widths[0]
            ]
    found += [
        f"line {row + 1}: a row outside a table"
        for row, line in enumerate(lines)
        if line.lstrip().startswith("|") and row not in in_tables
    ]
    return found


def cells(row: str) -> int:
    """A bar behind a backslash is part of its cell, inside code, too."""
    return len(re.split(r"(?<!\\)\|", row.strip().removeprefix("|").removesuffix("|")))


@each("page", PAGES)
def test_every_table_is_rendered(page: str) -> None:
    assert problems((ROOT / page).read_text("utf-8")) == []


@each(
    ("text", "problem"),
    [
        ("| a | b |\n| - | - |\n| 1 | 2 |\n", None),
        ("| a | b |\n| - | - |\n| 1 | `x \\| y` |\n", None),
        ("| a | b |\n| - | - |\n| 1 | x | y |\n", "line 3: 3 cells, the header has 2"),
        ("| a | b |\n| - | - |\n| 1 |\n", "line 3: 1 cells, the header has 2"),
        ("| a | b |\n| - | - |\n| 1 | 2 |\n\n| 3 | 4 |\n", "line 5: a row outside a table"),
        ("| a | b |\n| - |\n", "line 1: a row outside a table"),
    ],
)
def test_a_broken_table_is_found(text: str, problem: str | None) -> None:
    assert problems(text)[:1] == ([] if problem is None else [problem])
