"""The linter of private words finds them where they are prose, and nowhere else."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import yaml

from support.cases import each

TOOLS = Path(__file__).parents[2] / "tools"


def _loaded() -> Any:
    spec = importlib.util.spec_from_file_location("check_words", TOOLS / "check_words.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # a dataclass looks for its own module
    spec.loader.exec_module(module)
    return module


check_words = _loaded()
SETTINGS = yaml.safe_load((TOOLS / "words.yaml").read_text("utf-8"))
WORDS = [check_words.Word.of(entry["word"], entry["better"]) for entry in SETTINGS["words"]]


def found(text: str) -> list[tuple[int, str]]:
    hits = check_words.hits([check_words.Prose(1, text)], WORDS)
    return [(hit.line, hit.found) for hit in hits]


@each("entry", SETTINGS["words"], ids=lambda entry: entry["better"])
def test_a_word_is_found_and_what_resembles_it_is_not(entry: dict[str, Any]) -> None:
    word = check_words.Word.of(entry["word"], entry["better"])
    for text in entry["wrong"]:
        assert check_words.hits([check_words.Prose(1, text)], [word]), text
    for text in entry["right"]:
        assert found(text) == []


@each(
    ("name", "text", "lines"),
    [
        ("a.md", "one\nthe value in\nforce\n", [2]),
        ("a.md", "`in force` and\n```\nin force\n```\n[x](in-force.md)\n", []),
        ("a.py", '"""In force."""\n\nin_force = 1  # the former one\n', [1, 3]),
        ("a.py", "# the values in\n# force\nformer = told = 1\n", [1]),
        ("a.py", 'key = "former"\ntext = f"the {1} former " "board"\n', [2]),
        ("a.cpp", "/// The setpoint in\n/// force.\nint former = 1'000;  // told\n", [1, 3]),
        ("a.cpp", 'auto text = "the former"\n    " board";\n', [1]),
        ("a.toml", 'why = "in force"  # in force\n', [1]),
        ("a.svg", "in force", []),
    ],
)
def test_prose_of_each_kind_of_file(tmp_path: Path, name: str, text: str, lines: list[int]) -> None:
    (tmp_path / name).write_text(text)
    hits = check_words.hits(check_words.prose_of(tmp_path / name), WORDS)
    assert [hit.line for hit in hits] == lines
