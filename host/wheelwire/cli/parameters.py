"""`wheelwire params`: list, get, set, save, reset. `parameter_files` adds export, import, diff."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated, Any, cast

import typer
import typer.core
from rich.padding import Padding

from wheelwire.errors import InvalidArgument
from wheelwire.parameters import ParameterInfo
from wheelwire_protocol.codes import Fault
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from .address import (
    ROBOT_HELP,
    BaudRateOption,
    RobotArgument,
    complete_robot_or_name,
    looks_like_address,
    outlives_commands,
    resolve,
)
from .output import JsonFlag, UsageError, console, print_json, print_table, show_help_alone

_FLASH_FAULTS = Fault.STORE_FULL | Fault.STORE_UNREADABLE
TABLE_COLUMNS = 100
"""Narrower terminals get a list in place of a table."""

RESTART = "press EN (or RST) on the board, or take its power away for a moment"

app = typer.Typer()


class RobotCommand(typer.core.TyperCommand):
    """A command whose usage line shows the metavars of its arguments unchanged."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:  # noqa: ARG002 - Click's signature
        """Without the brackets and dots that some releases of Typer add."""
        arguments = (p for p in self.params if p.param_type_name == "argument")
        return [self.options_metavar or "", *(str(argument.metavar) for argument in arguments)]


def _arguments(names: str) -> Any:
    """ROBOT, which may be left out, and names or values after it, as one list for Click."""
    return typer.Argument(
        metavar=f"[ROBOT] {names}",
        help=f"{ROBOT_HELP} `wheelwire params list` shows the names.",
        show_default=False,
        autocompletion=complete_robot_or_name,
    )


def _split(
    context: typer.Context, arguments: Sequence[str], *names: str
) -> tuple[str | None, list[str]]:
    """Split into ROBOT, if given, and the values of all `names`."""
    for argument in arguments:
        if argument.startswith("--"):
            raise UsageError(f"No such option: {argument}", context)
    missing = len(names) - len(arguments)
    if missing == 0 and looks_like_address(arguments[0]):
        missing = 1  # it is ROBOT, and the last argument is missing
    if missing > 0:
        raise UsageError(f"Missing argument '{names[-missing]}'", context)
    # One argument more than names is ROBOT.
    if missing < -1:
        raise UsageError(f"Unexpected argument '{arguments[len(names) + 1]}'", context)
    robot = arguments[0] if len(arguments) > len(names) else None
    return robot, list(arguments[-len(names) :])


@app.callback(invoke_without_command=True)
def params(context: typer.Context) -> None:
    """Show and change the robot's parameters."""
    show_help_alone(context)


@app.command("list")
def list_all(
    robot: RobotArgument = None, baud_rate: BaudRateOption = None, as_json: JsonFlag = False
) -> None:
    """List all parameters with value, unit, bounds and meaning."""
    # Bare: with a robot's file the values on the robot are shown, not replaced by the file's.
    with resolve(robot, as_json=as_json).open(baud_rate, bare=True) as driver:
        parameters = driver.parameters.list()
    if as_json:
        print_json(parameters)
        return
    if console.width < TABLE_COLUMNS:
        for p in parameters:
            console.print(f"{p.name} = {_value(p)}, {p.minimum:g}..{p.maximum:g}", style="cyan")
            console.print(Padding(p.doc, (0, 0, 0, 4)))
        return
    print_table(
        "Parameters",
        ("name", "value", "bounds", "meaning"),
        [(p.name, _value(p), f"{p.minimum:g}..{p.maximum:g}", p.doc) for p in parameters],
    )


def _value(parameter: ParameterInfo) -> str:
    """The value with its unit, and the default if it differs."""
    text = f"{parameter.value:g} {parameter.unit}".rstrip()
    if parameter.value == parameter.default:
        return text
    return f"{text} (default {parameter.default:g})"


@app.command("get", cls=RobotCommand)
def get(
    context: typer.Context,
    arguments: Annotated[list[str] | None, _arguments("NAME")] = None,
    baud_rate: BaudRateOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Show one value."""
    robot, (name,) = _split(context, arguments or (), "NAME")
    with resolve(robot, as_json=as_json).open(baud_rate, bare=True) as driver:
        value = driver.parameters[name]
    if as_json:
        print_json({name: value})
    else:
        console.print(f"{value:g}")


# Unknown options are ignored, so that a negative VALUE is not mistaken for one; `_split` rejects
# what really is an option.
@app.command("set", cls=RobotCommand, context_settings={"ignore_unknown_options": True})
def set_value(
    context: typer.Context,
    arguments: Annotated[list[str] | None, _arguments("NAME VALUE")] = None,
    save: Annotated[bool, typer.Option("--save", help="Save this value, too.")] = False,
    baud_rate: BaudRateOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Change one value until the next reset; with --save also after it. Saves no other value."""
    robot, (name, value) = _split(context, arguments or (), "NAME", "VALUE")
    address = resolve(robot, as_json=as_json)
    address.check_parameters([name], save=save)
    with address.open(baud_rate) as driver:
        lasting = outlives_commands(driver)
        in_force = driver.parameters.set(name, _number(value))
        if save:
            driver.parameters.save(name)
    if as_json:
        print_json({name: in_force, "saved": save})
    else:
        console.print(
            f"{name} = {in_force:g}, {_duration(name, saved=save, lasting=lasting)}", soft_wrap=True
        )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return cast("float", text)  # the parameter's own check then says what is allowed


def _duration(name: str, *, saved: bool, lasting: bool) -> str:
    """How long a value applies. `lasting`: the robot's core keeps running after this command."""
    if not lasting:
        return "saved" if saved else "for this command only: the robot's process ended with it"
    if not PARAMETER_BY_NAME[name].after_reset:
        return "saved" if saved else "until the next reset; --save keeps it"
    if saved:
        return f"saved; takes effect at the next start: {RESTART}"
    return (
        f"no effect: it acts only from the next start, and is lost then; use --save, then {RESTART}"
    )


@app.command("save", cls=RobotCommand)
def save_values(
    arguments: Annotated[list[str] | None, _arguments("[NAME]...")] = None,
    baud_rate: BaudRateOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Save parameters: those named, or all, including those only changed for a try.

    The first argument is taken as ROBOT if it is `mock`, an existing file or contains / : or a
    dot; otherwise it is a parameter's name.
    """
    names = list(arguments or ())
    robot = names.pop(0) if names and looks_like_address(names[0]) else None
    address = resolve(robot, as_json=as_json)
    address.check_parameters(names, save=True)
    with address.open(baud_rate) as driver:
        for name in names:
            driver.parameters[name]  # raises for an unknown name before anything is saved
        for wanted in names or (None,):
            driver.parameters.save(wanted)
        # Asked for anew: they are shown as the robot has them.
        listed = {p.name: p for p in driver.parameters.list()}
    kept = {name: listed[name] for name in names} if names else listed
    if as_json:
        print_json({"saved": {name: p.value for name, p in kept.items()}})
        return
    shown = [p for p in kept.values() if names or p.value != p.default]
    values = ", ".join(f"{p.name} = {p.value:g}" for p in shown)
    if names:
        console.print(f"saved: {values}", soft_wrap=True)
    else:
        console.print(
            f"all values saved; different from their defaults: {values or 'none'}", soft_wrap=True
        )


@app.command("reset")
def reset_all(
    robot: RobotArgument = None,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Do not ask before the board is erased, too.")
    ] = False,
    baud_rate: BaudRateOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Reset all parameters to their defaults, the saved ones included.

    Where the flash cannot be opened (STORE_FULL, STORE_UNREADABLE) this erases the board, too: then
    nothing drives until `wheelwire board write`. It asks before that.
    """
    with resolve(robot, as_json=as_json).open(baud_rate) as driver:
        damaged = driver.read().faults & _FLASH_FAULTS
        if damaged and not yes:
            _ask_to_erase(damaged)
        driver.parameters.reset()
    if as_json:
        print_json({"reset": True})
    else:
        console.print("all parameters reset to their defaults")


def _ask_to_erase(damaged: Fault) -> None:
    names = " and ".join(str(fault.name) for fault in Fault if fault in damaged)
    text = (
        f"{names}: where the flash cannot be opened, resetting the parameters erases the board, "
        "too; afterwards nothing drives until `wheelwire board write`"
    )
    # The question goes to standard error; standard output may be a file or a pipe.
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise InvalidArgument(f"{text}. There is no terminal to ask on: add --yes to go on")
    if not typer.confirm(f"{text}. Go on?", err=True):
        raise InvalidArgument("nothing was reset")
