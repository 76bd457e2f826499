"""Answers to the questions of a set-up, so that it runs without a person."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from .reading import Section, reading


def load_answers(file: Path, forms: Mapping[str, Callable[[object], object]]) -> dict[str, object]:
    """Read a file, and check each answer before anything moves.

    Args:
        file: A YAML file; it need not have all answers.
        forms: By key, a function that raises InvalidArgument for an invalid answer.

    Raises:
        ConfigurationError: The file or an answer in it is invalid.
    """
    with reading(file, "answers") as content:
        answers = Section({} if content is None else content, forms).values
        for key, answer in answers.items():
            forms[key](answer)
    return answers
