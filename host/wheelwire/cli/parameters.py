"""`wheelwire params`: list, get, set, save, reset."""

from __future__ import annotations

from typing import Annotated, cast

import typer
from rich.padding import Padding

from wheelwire.drivers.serial import DEFAULT_BAUD_RATE, SerialDriver
from wheelwire.parameters import ParameterInfo
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from .output import JsonFlag, console, print_json, print_table, show_help_alone
from .robot import BaudOption, PortArgument

TABLE_COLUMNS = 100
"""A table has room for the meanings where the terminal is as wide as this."""

app = typer.Typer()

NameArgument = Annotated[str, typer.Argument(help="As `wheelwire params list` shows it.")]


@app.callback(invoke_without_command=True)
def params(context: typer.Context) -> None:
    """Show and change the robot's parameters."""
    show_help_alone(context)


@app.command("list")
def list_all(
    port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE, as_json: JsonFlag = False
) -> None:
    """List all parameters with value, unit, bounds and meaning."""
    with SerialDriver(port, baud_rate=baud) as robot:
        parameters = robot.parameters.list()
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
    """The value with its unit, and the default where it differs."""
    text = f"{parameter.value:g} {parameter.unit}".rstrip()
    if parameter.value == parameter.default:
        return text
    return f"{text} (default {parameter.default:g})"


@app.command("get")
def get(
    port: PortArgument,
    name: NameArgument,
    baud: BaudOption = DEFAULT_BAUD_RATE,
    as_json: JsonFlag = False,
) -> None:
    """Show one value."""
    with SerialDriver(port, baud_rate=baud) as robot:
        value = robot.parameters[name]
    if as_json:
        print_json({name: value})
    else:
        console.print(f"{value:g}")


# A negative number is no option, though it begins like one.
@app.command("set", context_settings={"ignore_unknown_options": True})
def set_value(
    port: PortArgument,
    name: NameArgument,
    value: Annotated[str, typer.Argument(help="A number, in the parameter's unit.")],
    save: Annotated[bool, typer.Option("--save", help="Keep this value across resets.")] = False,
    baud: BaudOption = DEFAULT_BAUD_RATE,
    as_json: JsonFlag = False,
) -> None:
    """Change one value until the next reset, or for good with --save. No other value is saved."""
    with SerialDriver(port, baud_rate=baud) as robot:
        in_force = robot.parameters.set(name, _number(value))
        if save:
            robot.parameters.save(name)
    if as_json:
        print_json({name: in_force, "saved": save})
    else:
        console.print(f"{name} = {in_force:g}, {_duration(name, saved=save)}", soft_wrap=True)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return cast("float", text)  # the parameter's own check says what it takes


def _duration(name: str, *, saved: bool) -> str:
    """From when and until when a value holds."""
    if not PARAMETER_BY_NAME[name].after_reset:
        return "saved" if saved else "until the next reset; --save keeps it"
    if saved:
        return "saved; in force after the next reset"
    return "without effect: it acts after a reset, which forgets it; give --save, then reset"


@app.command("save")
def save_values(
    port: PortArgument,
    names: Annotated[
        list[str] | None, typer.Argument(help="Which; default: all, also those only tried.")
    ] = None,
    baud: BaudOption = DEFAULT_BAUD_RATE,
    as_json: JsonFlag = False,
) -> None:
    """Keep values across resets: those named, or all."""
    with SerialDriver(port, baud_rate=baud) as robot:
        for name in names or ():
            robot.parameters[name]  # all names are known, or none is saved
        for wanted in names or (None,):
            robot.parameters.save(wanted)
        told = {p.name: p for p in robot.parameters.list()}
    kept = {name: told[name] for name in names} if names else told
    if as_json:
        print_json({"saved": {name: p.value for name, p in kept.items()}})
        return
    shown = [p for p in kept.values() if names or p.value != p.default]
    values = ", ".join(f"{p.name} = {p.value:g}" for p in shown)
    if names:
        console.print(f"saved: {values}", soft_wrap=True)
    else:
        console.print(
            f"all values saved; other than their defaults: {values or 'none'}", soft_wrap=True
        )


@app.command("reset")
def reset_all(
    port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE, as_json: JsonFlag = False
) -> None:
    """Reset all parameters to their defaults, and forget what was saved."""
    with SerialDriver(port, baud_rate=baud) as robot:
        robot.parameters.reset()
    if as_json:
        print_json({"reset": True})
    else:
        console.print("all parameters reset to their defaults")
