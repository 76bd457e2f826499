"""What typer's prompts read a line with."""

from __future__ import annotations

import os
import select
import signal
import sys
import textwrap
from shutil import get_terminal_size
from typing import Any

import typer

from wheelwire.errors import InvalidArgument

PIPE_BYTES = 4096


def read_line(prompt: str = "") -> str:
    """As `input`, at a terminal without its gap in which Ctrl-C is lost.

    `input` shows its prompt and begins to wait within one call. Python notes a signal that comes in
    between, but handles it only when that call returns: at the next line, or at a second Ctrl-C.
    This function waits for a line or for a signal noted by then, whichever comes first.

    Raises:
        InvalidArgument: There is no line any more.
    """
    if not sys.stdin.isatty():
        try:
            return input(prompt)
        except EOFError:
            raise _no_answer() from None
    sys.stdout.write(_wrapped(prompt))
    sys.stdout.flush()
    noted, note = os.pipe()
    os.set_blocking(note, False)
    before = signal.set_wakeup_fd(note, warn_on_full_buffer=False)
    try:
        # A terminal hands over one line at a time, so none is in Python's buffer.
        while noted in select.select([sys.stdin, noted], [], [])[0]:
            os.read(noted, PIPE_BYTES)  # its handler has run, and raised nothing
    finally:
        signal.set_wakeup_fd(before)
        os.close(noted)
        os.close(note)
    line = sys.stdin.readline()
    if not line:
        raise _no_answer()
    return line.rstrip("\n")


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


def _no_answer() -> InvalidArgument:
    # The line after the prompt is the error's.
    sys.stdout.write("\n")
    return InvalidArgument(
        "the question was not answered, because standard input has ended: run the command again, "
        "in a terminal"
    )


def use_read_line() -> None:
    """Have `typer.prompt` and `typer.confirm` read lines by `read_line`."""
    # Click keeps its function in a variable of this module, where its own test tools replace it,
    # too. Versions of typer differ in which copy of click they use.
    termui: Any = sys.modules[typer.prompt.__module__]
    termui.visible_prompt_func = read_line
