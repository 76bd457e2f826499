"""The commands: each module of this package registers its own, and `app` finds them."""

from __future__ import annotations

import enum
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from importlib import import_module
from inspect import Parameter, Signature, getdoc, signature
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

import typer

from .output import JsonFlag

_MODULES = {
    **dict.fromkeys(("clear", "drive", "estop", "info", "monitor", "restart", "stop"), "robot"),
    **dict.fromkeys(("demo", "mcu", "ports"), "local"),
    "params": "parameters",
}
"""Where the commands are whose module is not named after them."""
_ARGUMENT = re.compile(r"^    (\w+): (.+(?:\n {8}.+)*)", re.MULTILINE)
"""An entry of a docstring."""
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
        has_json: Whether it has the option `--json`.
    """

    name: str
    heading: Heading
    place: int
    page: str
    runs: Callable[..., Any] | typer.Typer
    has_json: bool


_commands: list[Command] = []


class Commands(typer.Typer):
    """Commands, each with the option `--json`, which `output.wants_json` looks for.

    A command's docstring has its help, and below `Args:` that of its options. A parameter of a
    class with `on_command_line` stands for several arguments and options.
    """

    def command(
        self, *names: Any, has_json: bool = True, **settings: Any
    ) -> Callable[[CommandT], CommandT]:
        """As Typer's."""
        register = super().command(*names, **settings)

        def add(runs: CommandT) -> CommandT:
            register(_expanded(runs, has_json=has_json))
            return runs

        return add


def _expanded(runs: Callable[..., Any], *, has_json: bool) -> Callable[..., Any]:
    """A function for Typer, which has each argument and option as a parameter."""
    text, _, listed = (getdoc(runs) or "").partition("\n\nArgs:\n")
    helps = {name: " ".join(said.split()) for name, said in _ARGUMENT.findall(listed)}
    hints = get_type_hints(runs, include_extras=True)
    shown: dict[str, Any] = {}
    last = {"as_json": JsonFlag} if has_json else {}
    defaults: dict[str, Any] = {"as_json": False}
    groups: dict[str, tuple[Any, list[str]]] = {}
    for name, parameter in signature(runs).parameters.items():
        kind, *argument = get_args(hints[name]) or (hints[name],)
        if hasattr(kind, "on_command_line"):
            arguments, options = kind.on_command_line(*argument)
            groups[name] = kind, [*arguments, *options]
            shown |= arguments
            last = options | last
        else:
            shown[name] = _described(name, hints[name], helps.get(name, ""))
            defaults[name] = parameter.default

    @wraps(runs)
    def run(**given: Any) -> object:
        given.pop("as_json", None)
        for name, (kind, parts) in groups.items():
            given[name] = kind(**{part: given.pop(part) for part in parts})
        return runs(**given)

    run.__doc__ = text
    run.__annotations__ = shown | last
    run.__signature__ = Signature(  # type: ignore[attr-defined]
        [
            Parameter(name, Parameter.KEYWORD_ONLY, default=defaults.get(name), annotation=hint)
            for name, hint in run.__annotations__.items()
        ]
    )
    return run


def _described(name: str, hint: Any, said: str) -> Any:
    """The annotation of an argument or option, with its help."""
    if hint is typer.Context:
        return hint
    if not hasattr(hint, "__metadata__"):
        # Otherwise a flag would have an opposite.
        names = [f"--{name.replace('_', '-')}"] if hint is bool else []
        return Annotated[hint, typer.Option(*names, help=said)]
    (info,) = hint.__metadata__
    info.help = info.help or said
    return hint


def command(
    name: str, heading: Heading, place: int, *, page: str = "", has_json: bool = True
) -> Callable[[CommandT], CommandT]:
    """Register what this decorates, or is called with, as a command; see `Command`."""

    def register(runs: CommandT) -> CommandT:
        _commands.append(Command(name, heading, place, page, runs, has_json))
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
