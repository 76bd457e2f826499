"""How results are shown: a table or a line for a person, JSON for a machine."""

from __future__ import annotations

import dataclasses
import enum
import json
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

console = Console(highlight=False, markup=False)

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""Click's, or that of the copy of Click inside Typer: releases differ."""

JsonFlag = Annotated[bool, typer.Option("--json", help="JSON on stdout, for machines.")]


def plain(value: Any) -> Any:
    """A value as JSON can hold it: names for enumerations, null for NaN."""
    if isinstance(value, enum.Flag):
        return [member.name for member in type(value) if member in value]
    if isinstance(value, enum.Enum):
        return value.name
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if hasattr(value, "_asdict"):
        return {key: plain(item) for key, item in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_json(value: Any) -> None:
    """One line of JSON, written at once."""
    print(json.dumps(plain(value)), flush=True)  # noqa: T201 - stdout is this module's task


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table; the first column names, the others are values."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        table.add_column(column, style="cyan" if index == 0 else "", no_wrap=index == 0)
    for row in rows:
        table.add_row(*(str(cell) for cell in row))
    console.print(table)


def print_facts(title: str, facts: Sequence[tuple[str, object]]) -> None:
    """Names and values, without headings."""
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False)
    table.add_column(style="cyan", no_wrap=True)
    table.add_column()
    for name, value in facts:
        table.add_row(name, str(value))
    console.print(table)


def show_help_alone(context: typer.Context) -> None:
    """Without a subcommand: which there are."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(2)


def print_error(message: str, kind: str, exit_code: int, *, as_json: bool) -> None:
    """One line on stderr: what happened and what to do."""
    error = {"error": kind, "message": message, "exit_code": exit_code}
    print(json.dumps(error) if as_json else f"wheelwire: {message}", file=sys.stderr)  # noqa: T201
