"""The commands: each module of this package registers its own, and `app` finds them."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, TypeVar

import typer

_MODULES = {
    **dict.fromkeys(("clear", "drive", "estop", "info", "monitor", "restart", "stop"), "robot"),
    **dict.fromkeys(("demo", "mcu", "ports"), "local"),
    "params": "parameters",
}
"""Where the commands are whose module is not named after them."""
_OF_ALL = "help"
"""The command that tells of all others."""

CommandT = TypeVar("CommandT", bound=Callable[..., Any] | typer.Typer)


class Heading(enum.Enum):
    """The heading under which the help lists a command, in this order."""

    BUILD = "Build a robot"
    DRIVE = "Drive"
    LOOK = "Look, and find out why"
    WITHOUT_ROBOT = "Without a robot"


@dataclass(frozen=True)
class Command:
    """A command of `wheelwire`.

    Attributes:
        name: Its first word.
        heading: Where the help lists it.
        place: Where among those of its heading; the least comes first.
        page: The page, and section, that explains it; its help ends with that. Empty: none.
        runs: What it runs, or the subcommands.
    """

    name: str
    heading: Heading
    place: int
    page: str
    runs: Callable[..., Any] | typer.Typer


_commands: list[Command] = []


def command(
    name: str, heading: Heading, place: int, *, page: str = ""
) -> Callable[[CommandT], CommandT]:
    """Register what this decorates, or is called with, as a command; see `Command`."""

    def register(runs: CommandT) -> CommandT:
        _commands.append(Command(name, heading, place, page, runs))
        return runs

    return register


def commands(word: str = "") -> list[Command]:
    """The commands of all other modules in this folder, as the help lists them.

    Args:
        word: If it names a command, only that one is returned: to import all takes longer than
            many a command does.
    """
    modules = [module.name for module in iter_modules([str(Path(__file__).parent)])]
    module = _MODULES.get(word, word)
    if module in modules and word != _OF_ALL:
        import_module(f"{__package__}.{module}")
        if named := [one for one in _commands if one.name == word]:
            return named
    for module in modules:
        import_module(f"{__package__}.{module}")
    headings = list(Heading)
    return sorted(_commands, key=lambda one: (headings.index(one.heading), one.place))
