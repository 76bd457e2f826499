"""How results are printed: as text or a table for people, as JSON for programs; and progress."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.status import Status
from rich.table import Table
from rich.text import Text

from wheelwire.errors import OutputFailed
from wheelwire.samples import to_json_value as to_json_value

console = Console(highlight=False, markup=False)
error_console = Console(highlight=False, markup=False, stderr=True)

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""Click's class, or the one of the copy of Click inside Typer: releases of Typer differ."""

JsonFlag = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def wants_json() -> bool:
    """Whether this command prints JSON."""
    # Not from the parsed options: an error may be that they cannot be parsed.
    return "--json" in takewhile("--".__ne__, sys.argv)


def screen() -> Console:
    """Where a person sees what is not the result: with --json, standard output is that alone."""
    return error_console if wants_json() else console


def print_json(value: Any) -> None:
    """Print one line of JSON and flush it."""
    print(json.dumps(to_json_value(value)), flush=True)  # noqa: T201 - stdout is this module's task


def printed_json(value: Any) -> bool:
    """Print the result as JSON if this command prints JSON; whether it does."""
    if is_wanted := wants_json():
        print_json(value)
    return is_wanted


def print_lines(*lines: str, style: str | None = None) -> None:
    """Print lines for people, each as long as it is: only a terminal breaks them."""
    for line in lines:
        console.print(line, style=style, soft_wrap=True)


def print_result(result: object, text: str) -> None:
    """Print what a command has done: as JSON, or as a line for people."""
    if not printed_json(result):
        print_lines(text)


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    *,
    show_header: bool = True,
) -> None:
    """Print a table; the first column has the names."""
    table = Table(title=title, title_justify="left", title_style="bold", show_header=show_header)
    for index, column in enumerate(columns):
        table.add_column(column, style="cyan" if index == 0 else "", no_wrap=index == 0)
    for row in rows:
        table.add_row(*(str(cell) for cell in row))
    console.print(table)


def print_facts(title: str, facts: Sequence[tuple[str, object]]) -> None:
    """Print names and values, without headings."""
    print_table(title, ("name", "value"), facts, show_header=False)


def show_help_alone(context: typer.Context) -> None:
    """Print the help and exit if no subcommand was given."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(2)


def print_error(message: str, kind: str, exit_code: int, more: str = "") -> None:
    """Print one line on stderr: what happened, what to do, and the command in `more`."""
    error = {"error": kind, "message": message, "exit_code": exit_code}
    if more:
        error["more"] = more
        message = f"{message} (more: {more})"
    _tell(error, message)


def print_interruption(message: str, exit_code: int) -> None:
    """Print one line on stderr: what was done before a signal ended the command."""
    if sys.stderr.isatty():
        print(file=sys.stderr)  # noqa: T201 - the terminal shows ^C where the cursor was
    print_error(message, "Interrupted", exit_code)


def print_note(text: str) -> None:
    """Print one line on stderr that is neither a result nor an error."""
    _tell({"note": text}, text)


def _tell(value: object, text: str) -> None:
    print(json.dumps(value) if wants_json() else f"wheelwire: {text}", file=sys.stderr)  # noqa: T201


def check_writable(file: Path | None) -> None:
    """Find out before anything moves or is asked; raises `OutputFailed`."""
    if file is None:
        return
    is_special = file.exists() and not file.is_file()
    # A regular file is replaced by a new one in its folder.
    needed = [file] * file.exists() + [file.resolve().parent] * (not is_special)
    if file.is_dir() or not all(os.access(one, os.W_OK) for one in needed):
        raise OutputFailed(f"cannot write {file}: choose a file in a folder that can be written")


def write_new(file: Path, content: bytes) -> None:
    """Write a file that does not exist yet; one that cannot be finished is removed.

    Raises:
        FileExistsError: It exists.
        OSError: It cannot be written.
    """
    with file.open("xb") as out:
        try:
            out.write(content)
            out.flush()
            os.fsync(out.fileno())  # from here on it may be the only copy
        except BaseException:
            file.unlink(missing_ok=True)
            raise


class TimeLeft:
    """A line that counts down while the wheels turn; a context manager.

    If the output is not a terminal, it shows nothing.

    Args:
        console: Any other output during the countdown must also go to it.
        now: Reads a clock [s].
    """

    def __init__(self, console: Console, now: Callable[[], float] = time.monotonic) -> None:
        self._status = Status(self, console=console, spinner="line", refresh_per_second=4)
        self._is_shown = False
        self._now = now
        self._begin = 0.0
        self._end = 0.0

    def __enter__(self) -> TimeLeft:
        return self

    def __exit__(self, *_: object) -> None:
        self.show(0.0)

    def show(self, left_s: float) -> None:
        """Show that the wheels turn for about this long; 0: they stand, and the line disappears."""
        now = self._now()
        if left_s <= 0.0:
            self._status.stop()
            self._is_shown = False
            return
        if not self._is_shown:
            self._begin = now
        self._end = now + left_s
        if self._status.console.is_terminal and not self._is_shown:
            self._status.start()
        self._is_shown = True

    def __rich__(self) -> Text:
        """The line as it is now."""
        now = self._now()
        # What takes longer than expected is not over yet.
        left_s = max(1.0, self._end - now)
        done = (now - self._begin) / (now - self._begin + left_s)
        return Text(f"the wheels turn: {done:.0%} done, about {left_s:.0f} s left")
