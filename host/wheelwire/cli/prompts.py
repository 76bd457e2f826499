"""Questions at a terminal. They go to standard error where standard output may be a pipe."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import textwrap
from collections.abc import Callable
from shutil import get_terminal_size
from typing import TypeVar

from wheelwire.errors import InvalidArgument

PIPE_BYTES = 4096

_T = TypeVar("_T")


def can_ask() -> bool:
    """Whether somebody sees the questions and can answer them."""
    # They go to standard error; standard output may be a file or a pipe.
    return sys.stdin.isatty() and sys.stderr.isatty()


def ask(question: str, default: object = None, *, err: bool = True) -> str:
    """The answer to a question; Enter gives the default, and without one asks again.

    Raises:
        InvalidArgument: Standard input has ended.
    """
    return ask_until(question, str, default, err=err)


def ask_until(
    question: str, parse: Callable[[str], _T], default: object = None, *, err: bool = True
) -> _T:
    """As `ask`, until `parse` takes the answer; its `InvalidArgument` is shown before each repeat.

    Raises:
        InvalidArgument: Standard input has ended.
    """
    prompt = f"{question}: " if default is None else f"{question} [{default}]: "
    # Not before a repeat, too: nothing has happened since the answer that was wrong.
    _discard_typed_ahead()
    while True:
        answer = read_line(prompt, err=err)
        if not answer and default is None:
            continue
        try:
            return parse(answer or str(default))
        except InvalidArgument as error:
            _show(f"{error}\n", err=err)


def ask_yes_or_no(question: str, *, default: bool = False) -> bool:
    """Whether the answer is yes.

    Raises:
        InvalidArgument: Standard input has ended.
    """
    prompt = f"{question} [{'Y/n' if default else 'y/N'}]: "
    _discard_typed_ahead()
    while True:
        answer = read_line(prompt).lower()
        if answer in ("", "y", "yes", "n", "no"):
            return answer.startswith("y") if answer else default
        _show("answer y or n\n", err=True)


def read_line(prompt: str, *, err: bool = True) -> str:
    """As `input`, but at a terminal Ctrl-C is never lost.

    `input` shows its prompt and begins to wait within one call. Python notes a signal that comes in
    between, but handles it only when that call returns: at the next line, or at a second Ctrl-C.
    This function waits for a line or a signal, even a signal that has already come.

    Raises:
        InvalidArgument: The input has ended.
    """
    _show(_wrapped(prompt) if sys.stdin.isatty() else prompt, err=err)
    if sys.stdin.isatty():
        _wait_for_a_line()
    line = sys.stdin.readline()
    if not line:
        _show("\n", err=err)  # the line after the prompt is the error's
        raise InvalidArgument(
            "the question was not answered, because standard input has ended: run the command "
            "again, in a terminal"
        )
    return line.strip()


def _discard_typed_ahead() -> None:
    """An Enter pressed during the step before must not answer whether the robot may drive."""
    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def _show(text: str, *, err: bool) -> None:
    stream = sys.stderr if err else sys.stdout
    stream.write(text)
    stream.flush()


def _wait_for_a_line() -> None:
    """A terminal hands over one line at a time, so none is in Python's buffer."""
    noted, note = os.pipe()
    os.set_blocking(note, False)
    before = signal.set_wakeup_fd(note, warn_on_full_buffer=False)
    try:
        while noted in select.select([sys.stdin, noted], [], [])[0]:
            os.read(noted, PIPE_BYTES)  # its handler has run, and raised nothing
    finally:
        signal.set_wakeup_fd(before)
        os.close(noted)
        os.close(note)


def _wrapped(prompt: str) -> str:
    """As a terminal shows it, which would break a long line within a word."""
    columns = get_terminal_size().columns
    lines = textwrap.wrap(
        prompt.rstrip(" "),
        max(columns - 1, 10),  # a blank follows the last line
        break_long_words=False,
        break_on_hyphens=False,
        drop_whitespace=True,
    )
    blanks = prompt[len(prompt.rstrip(" ")) :]
    return "\n".join(lines) + blanks
