"""The line that counts down while the wheels turn."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from wheelwire.cli.output import TimeLeft


def test_it_counts_down_and_corrects_itself() -> None:
    now_s = 100.0
    with TimeLeft(Console(file=io.StringIO()), lambda: now_s) as left:
        left.show(60.0)
        assert str(left.__rich__()) == "the wheels turn: 0% done, about 60 s left"
        now_s += 15.0
        assert str(left.__rich__()) == "the wheels turn: 25% done, about 45 s left"
        left.show(15.0)
        assert str(left.__rich__()) == "the wheels turn: 50% done, about 15 s left"
        now_s += 30.0  # longer than expected
        assert str(left.__rich__()) == "the wheels turn: 98% done, about 1 s left"
        left.show(0.0)
        left.show(10.0)
        assert str(left.__rich__()) == "the wheels turn: 0% done, about 10 s left"


def test_it_is_seen_at_a_terminal_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    for is_terminal in (True, False):
        output = io.StringIO()
        console = Console(file=output, force_terminal=is_terminal, width=80)
        with TimeLeft(console) as left:
            left.show(60.0)
            console.print("a line")
            left.show(0.0)
            gone = len(output.getvalue())
            console.print("a question")
        assert ("s left" in output.getvalue()) == is_terminal
        assert "s left" not in output.getvalue()[gone:]
        assert "a line" in output.getvalue()
