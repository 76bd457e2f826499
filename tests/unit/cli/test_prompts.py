"""Reading a line at a terminal: what is typed arrives, and Ctrl-C is never lost."""

from __future__ import annotations

import ctypes
import functools
import io
import os
import select
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from wheelwire.cli import prompts
from wheelwire.errors import InvalidArgument


class Terminal(io.TextIOWrapper):
    """Standard input, typed at `keyboard`."""

    def __init__(self) -> None:
        self.keyboard, end = os.openpty()
        super().__init__(os.fdopen(end, "rb"))

    def press(self, keys: bytes) -> None:
        os.write(self.keyboard, keys)

    def answer(self, monkeypatch: pytest.MonkeyPatch, *lines: bytes) -> None:
        """Type one of the lines at each question."""
        waiting, show = list(lines), prompts._show

        def shown(text: str, *, err: bool) -> None:
            show(text, err=err)
            if text.endswith(" "):
                self.press(waiting.pop(0))

        monkeypatch.setattr(prompts, "_show", shown)


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[Terminal]:
    with Terminal() as terminal:
        monkeypatch.setattr("sys.stdin", terminal)
        yield terminal
        os.close(terminal.keyboard)


def test_lines_that_are_typed_ahead(terminal: Terminal, capsys: pytest.CaptureFixture[str]) -> None:
    terminal.press(b"left\n\nx\x7fright\n")
    assert [prompts.read_line("which? ") for _ in range(3)] == ["left", "", "right"]
    assert capsys.readouterr().err == "which? " * 3


@pytest.mark.parametrize("columns", [12, 20, 37, 80, 200])
def test_no_question_breaks_within_a_word(
    terminal: Terminal,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    columns: int,
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    question = (
        "Do both wheels hang free, with nothing in their way? They will turn (yes, no) [no]: "
    )
    terminal.press(b"yes\n")
    assert prompts.read_line(question) == "yes"
    shown = capsys.readouterr().err
    assert shown.endswith(" ")
    assert shown.split() == question.split()
    assert max(len(line) for line in shown.split("\n")) <= columns


def test_the_end_of_the_input(terminal: Terminal) -> None:
    terminal.press(b"\x04")
    with pytest.raises(InvalidArgument, match="standard input has ended"):
        prompts.read_line("")


def test_input_that_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("left\nright\n"))
    assert [prompts.read_line(""), prompts.read_line("")] == ["left", "right"]
    with pytest.raises(InvalidArgument, match="standard input has ended"):
        prompts.read_line("")


def test_ctrl_c_in_the_last_moment_before_it_waits(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    real_select = select.select

    def select_after_a_signal(*lists: Any) -> Any:
        # Called from C one after the other: Python has no chance to handle the signal in between.
        calls = [
            functools.partial(ctypes.PyDLL(None)["raise"], int(signal.SIGINT)),
            functools.partial(real_select, *lists),
        ]
        return list(map(functools.partial.__call__, calls))[1]

    monkeypatch.setattr(select, "select", select_after_a_signal)
    # What ends the wait if the signal does not.
    timer = threading.Timer(5.0, terminal.press, [b"too late\n"])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        prompts.read_line("")
    assert timer.is_alive()
    timer.cancel()


def test_a_signal_whose_handler_returns_ends_no_wait(terminal: Terminal) -> None:
    handled = threading.Event()
    before = signal.signal(signal.SIGUSR1, lambda *_: handled.set())

    def signal_and_type() -> None:
        os.kill(os.getpid(), signal.SIGUSR1)
        assert handled.wait(30)
        terminal.press(b"left\n")

    typist = threading.Timer(0.05, signal_and_type)
    typist.start()
    assert prompts.read_line("") == "left"
    typist.join()
    signal.signal(signal.SIGUSR1, before)
    assert signal.set_wakeup_fd(-1) == -1


def test_enter_gives_the_default_and_without_one_the_question_comes_again(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal.answer(monkeypatch, b"\n", b"\n", b"right\n")
    assert [prompts.ask("Which?", "left", err=False), prompts.ask("Which?")] == ["left", "right"]
    assert capsys.readouterr() == ("Which? [left]: ", "Which?: Which?: ")


def test_an_enter_pressed_during_the_step_before_answers_nothing(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two of them drove a robot that had been set up."""
    terminal.press(b"\n\n")
    terminal.answer(monkeypatch, b"skip\n", b"n\n")
    assert prompts.ask("Drive 20 cm forward?", "yes") == "skip"
    terminal.press(b"yes\n")
    assert not prompts.ask_yes_or_no("Save them on the robot?")


def test_what_follows_a_wrong_answer_counts(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It may be typed before the question is there again."""

    def parse(given: str) -> float:
        try:
            return float(given)
        except ValueError:
            raise InvalidArgument("give a number") from None

    terminal.answer(monkeypatch, b"much\n2\n", b"")
    assert prompts.ask_until("How far?", parse) == 2.0
    assert capsys.readouterr().err == "How far?: give a number\nHow far?: "


def test_yes_or_no(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal.answer(monkeypatch, b"\n", b"Yes\n", b"maybe\n", b"n\n")
    assert [prompts.ask_yes_or_no("Go on?", default=d) for d in (True, False, True)] == [
        True,
        True,
        False,
    ]
    assert capsys.readouterr().err.count("Go on? [Y/n]: ") == 3  # once for "maybe"
