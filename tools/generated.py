"""What the writers of generated files share: write what differs or, with --check, name it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import mdformat

ROOT = Path(__file__).parents[1]


def write(files: Mapping[Path, str]) -> str | None:
    """Write the files that differ; with --check, return what to do about them."""
    stale = [path for path, text in files.items() if not _holds(path, text)]
    if stale and "--check" in sys.argv[1:]:
        return f"out of date: {', '.join(str(p.relative_to(ROOT)) for p in stale)}; run `make gen`"
    for path in stale:
        path.parent.mkdir(exist_ok=True)
        path.write_text(files[path], "utf-8")
    return None


def _holds(path: Path, text: str) -> bool:
    return path.exists() and path.read_text("utf-8") == text


def table(heading: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (heading, *rows)]
    return "\n".join([lines[0], "|" + "-|" * (lines[0].count(" | ") + 1), *lines[1:], ""])


def formatted(text: str) -> str:
    """A page as `make lint` wants it."""
    return mdformat.text(
        text, options={"wrap": 100, "compact_tables": True}, extensions={"gfm", "tables"}
    )


def filled(page: Path, parts: Mapping[str, str]) -> str:
    """The page with its generated parts, each between two comments, replaced."""
    text = page.read_text("utf-8")
    for name, part in parts.items():
        pattern = re.compile(rf"(<!-- {name}: generated -->\n).*?(<!-- end -->)", re.DOTALL)
        before, *rest = pattern.split(text)
        if len(rest) != 3:
            sys.exit(f"{page} does not have one place for the {name}")
        text = f"{before}{rest[0]}\n{part}\n{rest[1]}{rest[2]}"
    return formatted(text)
