"""Finds private words in the project's prose; `words.yaml` lists them, each with a better one.

Prose is Markdown without its code, comments, docstrings, and texts of more than one word. Names in
code are exempt, and so is what stands between backticks.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import yaml

ROOT = Path(__file__).parents[1]
WORDS = Path(__file__).with_name("words.yaml")
CPP = {".c", ".cpp", ".h", ".hpp"}
HASH_COMMENTS = {".cmake", ".hex", ".projbuild", ".sh", ".toml", ".txt", ".yaml", ".yml"}
HASH_NAMES = {"Dockerfile", "Makefile", "check-machine"}


class Prose(NamedTuple):
    """A piece of text and the line that it begins on."""

    line: int
    text: str


@dataclass(frozen=True)
class Word:
    """A private word."""

    pattern: re.Pattern[str]
    better: str

    @classmethod
    def of(cls, pattern: str, better: str) -> Word:
        """`pattern` with any white space for each of its spaces."""
        return cls(re.compile(pattern.replace(" ", r"\s+"), re.IGNORECASE | re.MULTILINE), better)


class Hit(NamedTuple):
    """Where a private word is."""

    line: int
    found: str
    better: str


def hits(prose: Iterable[Prose], words: Iterable[Word]) -> list[Hit]:
    """What of `words` is in `prose`, by line."""
    found = []
    for piece in prose:
        text = re.sub(r"`[^`]*`", lambda code: "`" + "\n" * code[0].count("\n") + "`", piece.text)
        for word in words:
            for match in word.pattern.finditer(text):
                line = piece.line + text.count("\n", 0, match.start())
                found.append(Hit(line, " ".join(match[0].split()), word.better))
    return sorted(found)


def prose_of(path: Path) -> list[Prose]:
    """The prose of a file of any kind."""
    text = path.read_text("utf-8", errors="replace")
    if path.suffix == ".md":
        return list(markdown(text))
    if path.suffix == ".py":
        return list(python(text))
    if path.suffix in CPP:
        return list(cpp(text))
    if path.suffix in HASH_COMMENTS or path.name in HASH_NAMES:
        return list(hash_comments(text))
    return []


def markdown(text: str) -> Iterator[Prose]:
    """The page, its code blocks and the targets of its links left empty."""

    def blank(match: re.Match[str]) -> str:
        return "\n" * match[0].count("\n")

    text = re.sub(r"^( *)```.*?^\1```$", blank, text, flags=re.MULTILINE | re.DOTALL)
    yield Prose(1, re.sub(r"\]\([^)]*\)", "]", text))


def python(text: str) -> Iterator[Prose]:
    """Comments, joined where they stand below each other, docstrings and texts."""
    comments = [
        (token.start[0], token.string.lstrip("#: "))
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT
    ]
    yield from joined(comments)
    nodes = list(ast.walk(ast.parse(text)))
    parts = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            yield Prose(node.lineno, "".join(literal(part) for part in node.values))
        elif isinstance(node, ast.Constant) and id(node) not in parts and " " in literal(node):
            yield Prose(node.lineno, literal(node))


def literal(node: ast.AST) -> str:
    """The text of a node; what an f-string has between its braces is code."""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else "{}"


def cpp(text: str) -> Iterator[Prose]:
    """Comments and texts, each joined with what continues it."""
    comments, texts = [], []
    for match in re.finditer(
        r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\'', text, re.DOTALL
    ):
        line = text.count("\n", 0, match.start()) + 1
        if match[0].startswith("/"):
            lines = match[0].removesuffix("*/").splitlines()
            comments += [(line + i, part.strip().lstrip("/*!<> ")) for i, part in enumerate(lines)]
        elif match[0].startswith('"'):
            texts.append((line, match[0][1:-1]))
    yield from joined(comments)
    yield from (piece for piece in joined(texts) if re.search(r"\s", piece.text))


def hash_comments(text: str) -> Iterator[Prose]:
    """What follows a # at the beginning of a line or behind a space."""
    found = re.compile(r"(?:^|(?<=\s))#\s*(.*)")
    lines = enumerate(text.splitlines(), start=1)
    yield from joined([(line, match[1]) for line, row in lines if (match := found.search(row))])


def joined(lines: list[tuple[int, str]]) -> Iterator[Prose]:
    """Pieces of prose out of single lines: those that follow each other belong together."""
    start, parts = 0, list[str]()
    for line, part in lines:
        if parts and line == start + len(parts):
            parts.append(part)
            continue
        if parts:
            yield Prose(start, "\n".join(parts))
        start, parts = line, [part]
    if parts:
        yield Prose(start, "\n".join(parts))


def main() -> int:
    """Print each hit as file:line, word and better word; 1 if there is any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", help="by default all, except what words.yaml exempts")
    named = parser.parse_args().files
    settings = yaml.safe_load(WORDS.read_text("utf-8"))
    words = [Word.of(entry["word"], entry["better"]) for entry in settings["words"]]
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    exempt = (*settings["generated"], *settings["not_yet"])
    count = 0
    for name in named or [name for name in listed if not name.startswith(exempt)]:
        path = ROOT / name
        if not path.is_file():
            continue
        for hit in hits(prose_of(path), words):
            print(f"{name}:{hit.line}: {hit.found!r}: better {hit.better}")
            count += 1
    if settings["not_yet"]:
        print(f"not yet covered: {', '.join(settings['not_yet'])}", file=sys.stderr)
    return min(count, 1)


if __name__ == "__main__":
    sys.exit(main())
