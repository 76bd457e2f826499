"""`wheelwire params`: list, get, set, save, reset."""

from __future__ import annotations

from typing import Annotated

import typer

from wheelwire.drivers.serial import DEFAULT_BAUD_RATE, SerialDriver
from wheelwire.parameters import ParameterInfo

from .output import JsonFlag, console, print_json, print_table, show_help_alone
from .robot import BaudOption, PortArgument

app = typer.Typer()

NameArgument = Annotated[str, typer.Argument(help="As `wheelwire params list` shows it.")]


@app.callback(invoke_without_command=True)
def params(context: typer.Context) -> None:
    """The robot's parameters."""
    show_help_alone(context)


@app.command("list")
def list_all(
    port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE, as_json: JsonFlag = False
) -> None:
    """All parameters with unit, bounds and meaning."""
    with SerialDriver(port, baud_rate=baud) as robot:
        parameters = robot.parameters.list()
    if as_json:
        print_json(parameters)
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
    """One value."""
    with SerialDriver(port, baud_rate=baud) as robot:
        value = robot.parameters[name]
    if as_json:
        print_json({name: value})
    else:
        console.print(f"{value:g}")


@app.command("set")
def set_value(
    port: PortArgument,
    name: NameArgument,
    value: Annotated[float, typer.Argument(help="In the parameter's unit.")],
    save: Annotated[bool, typer.Option(help="Keep it across resets.")] = False,
    baud: BaudOption = DEFAULT_BAUD_RATE,
    as_json: JsonFlag = False,
) -> None:
    """Change one value, until the next reset unless it is saved."""
    with SerialDriver(port, baud_rate=baud) as robot:
        in_force = robot.parameters.set(name, value)
        if save:
            robot.parameters.save()
    if as_json:
        print_json({name: in_force, "saved": save})
    else:
        console.print(f"{name} = {in_force:g}" + (", saved" if save else ", until the next reset"))


@app.command("save")
def save_all(port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE) -> None:
    """Keep all values across resets."""
    with SerialDriver(port, baud_rate=baud) as robot:
        robot.parameters.save()
    console.print("saved")


@app.command("reset")
def reset_all(port: PortArgument, baud: BaudOption = DEFAULT_BAUD_RATE) -> None:
    """Back to the defaults, and forget what was saved."""
    with SerialDriver(port, baud_rate=baud) as robot:
        robot.parameters.reset()
    console.print("all parameters have their defaults again")
