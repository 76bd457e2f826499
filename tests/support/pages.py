"""The pages of the site and their fenced blocks: which a test runs, and why the others are not.

A block of Python or of commands is run as it stands, unless the comment before it says which test
runs it, or why nothing can: `<!-- run by FILE: TEST -->`, `<!-- not run: REASON -->`.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = tuple(
    page.relative_to(ROOT).as_posix()
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
    # Decisions, and pages written elsewhere, contain no instructions.
    if page.parent.name not in {"adr", "project"}
)
REASONS = {
    "asks a person",
    "needs a robot",
    "needs ROS",
    "needs a network",
    "needs Windows",
    "changes this computer",
    "takes minutes",
}
COMMANDS = {"", "sh", "console"}
BLOCK = re.compile(
    r"(?:^ *<!-- (not run|run by)[: ]+([^\n]*?) -->\n+)?^( *)```([^\n]*)\n(.*?)^\3```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A block of Python or commands.

    Attributes:
        place: Page and line.
        language: `python`; otherwise it has commands.
        text: Without the indentation of a list.
        test: File and name of the test that runs it, or empty.
        excuse: Why nothing runs it, or empty.
    """

    place: str
    language: str
    text: str
    test: str
    excuse: str

    @property
    def commands(self) -> list[str]:
        """Its commands; with prompts, what follows them is output."""
        lines = self.text.splitlines()
        if any(line.startswith("$ ") for line in lines):
            return [line[2:] for line in lines if line.startswith("$ ")]
        return [line for line in lines if line and not line.startswith("#")]


def blocks(page: str) -> list[Block]:
    """The blocks of a page in their order."""
    text = (ROOT / page).read_text("utf-8")
    found = []
    for match in BLOCK.finditer(text):
        kind, remark, indent, language, content = match.groups()
        if language == "python" or language in COMMANDS:
            found.append(
                Block(
                    f"{page}:{text.count(chr(10), 0, match.start(3)) + 1}",
                    language,
                    re.sub(rf"^{indent}", "", content, flags=re.MULTILINE),
                    remark if kind == "run by" else "",
                    remark if kind == "not run" else "",
                )
            )
    return found


CELL = re.compile(r"(?<!`)`((?:robot\b(?!\.[ch]pp)|wheelwire )[^`]*)`(?!`)")


def code_in_rows(page: str) -> list[tuple[str, str]]:
    """Place and text of each expression of a robot in a page's tables, and command in its rows.

    Rows are those of tables, and items of lists; a list may name what only one driver has.
    """
    return [
        (f"{page}:{number}", code.replace("\\|", "|"))
        for number, row in _rows((ROOT / page).read_text("utf-8"))
        for code in CELL.findall(row)
        if code.startswith("wheelwire ")
        or (code.startswith(("robot.", "robot[")) and row.startswith("|"))
    ]


def _rows(text: str) -> Iterator[tuple[int, str]]:
    """The rows of tables, and the items of lists with all their lines, each with its number."""
    number, row = 0, ""
    for at, line in enumerate(text.splitlines(), 1):
        words = line.strip()
        if row.startswith("- ") and line.startswith("  ") and words[:2] not in {"- ", "``", "| "}:
            row += " " + words
            continue
        if row:
            yield number, row
        number, row = at, words if words.startswith(("|", "- ")) else ""
    if row:
        yield number, row


def count() -> Counter[str]:
    """How many blocks are run, here or by another test, and how many are not, by reason."""
    return Counter(
        block.excuse or ("run by another test" if block.test else "run")
        for page in PAGES
        for block in blocks(page)
    )


if __name__ == "__main__":
    lines = [f"{number:4} {what}" for what, number in count().most_common()]
    lines.append(f"{count().total():4} blocks of Python or commands on {len(PAGES)} pages")
    sys.stdout.write("\n".join(lines) + "\n")
