"""`wheelwire params export`, `import`, `diff`: copy a robot's parameters to another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from wheelwire.drivers.base import BaseDriver
from wheelwire.drivers.transport_driver import DeviceDriver
from wheelwire_protocol.codes import Board, SupervisorState
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, PLATFORM_DEFAULTS

from .address import (
    ROBOT_HELP,
    BaudRateOption,
    RobotArgument,
    complete_robot,
    complete_yaml,
    outlives_commands,
    resolve,
)
from .output import JsonFlag, UsageError, console, print_json, print_table
from .parameters import RobotCommand, app
from .signals import ended_by_signals

if TYPE_CHECKING:
    from wheelwire.link.info import DeviceInfo
    from wheelwire.parameter_file import Difference, ParameterFile

__all__ = ["app"]

DIFFERENT = 22
"""Exit code of `params diff` if values differ."""


def _complete(incomplete: str) -> Iterator[tuple[str, str]]:
    yield from complete_robot(incomplete)
    yield from complete_yaml(incomplete)


RobotAndFile = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[ROBOT] FILE",
        help=f"{ROBOT_HELP} FILE is one that `wheelwire params export` wrote.",
        show_default=False,
        autocompletion=_complete,
    ),
]


@app.command("export")
def export(
    robot: RobotArgument = None, baud_rate: BaudRateOption = None, as_json: JsonFlag = False
) -> None:
    """Print all parameters with their units, and the board's identity, as YAML.

    Write them to a file with `> FILE`; `params import` sets them on another robot.
    """
    from wheelwire.parameter_file import ParameterFile  # here, because YAML is slow to import

    with resolve(robot, as_json=as_json).open(baud_rate, bare=True) as driver:
        exported = ParameterFile.of_robot(driver.parameters.list(), _device(driver))
    if as_json:
        print_json(exported.as_mapping())
    else:
        typer.echo(exported.text(), nl=False)


@app.command("import", cls=RobotCommand)
def import_file(
    context: typer.Context,
    arguments: RobotAndFile = None,
    save: Annotated[bool, typer.Option("--save", help="Save these values, too.")] = False,
    baud_rate: BaudRateOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Set all values in a file until the next reset; with --save also after it.

    If one is refused or the link fails, the former values are set again.
    Parameters that are not in the file stay as they are.
    The file may be from another board.
    """
    from wheelwire.parameter_file import apply, differences, load_parameter_file, number_text

    # The file first: opening the robot stops it, which a wrong file should not do.
    robot, file = _split(context, arguments or ())
    wanted = load_parameter_file(file)
    address = resolve(robot, as_json=as_json)
    # Whether anything can be saved is known before the robot is opened. Which values would change,
    # and whether the robot's file would undo them, is known only then.
    address.check_parameters([], save=save)
    with ended_by_signals() as ending, address.open(baud_rate) as driver:
        ending.outcome = "interrupted; the previous values are set again"
        lasting, device = outlives_commands(driver), _device(driver)
        expected = differences(driver.parameters.list(), wanted.values)
        address.check_parameters([change.name for change in expected], save=save)
        changes = apply(driver.parameters, wanted.values, save=save)
        ending.outcome = "interrupted; the values in the file are set"
        driver.read()  # it may have been sent before the last change
        state = driver.read().state
    if as_json:
        print_json(
            {
                "changed": {change.name: change.file for change in changes},
                "saved": save,
                "state": state,
                **_boards(wanted, device),
            }
        )
        return
    for line in _notes(wanted, device):
        console.print(line, soft_wrap=True)
    for change in changes:
        console.print(
            f"{change.name}: {number_text(change.robot)} -> "
            f"{number_text(change.file)} {change.unit}".rstrip(),
            soft_wrap=True,
        )
    console.print(
        f"{len(changes)} of {len(wanted.values)} values changed, "
        f"{_duration(saved=save, lasting=lasting)}",
        soft_wrap=True,
    )
    # A core that ends with this command is never reset.
    after_reset = [c.name for c in changes if PARAMETER_BY_NAME[c.name].after_reset]
    if after_reset and lasting:
        act = "takes effect" if len(after_reset) == 1 else "take effect"
        unsaved = "" if save else ", and only if saved"
        console.print(f"{', '.join(after_reset)} {act} after the next reset{unsaved}")
    if state is SupervisorState.ESTOPPED:
        console.print(
            "an e-stop is latched: with estop_input_enabled 1 an open contact latches it; "
            f"`wheelwire clear {address.text}` ends it once the contact is closed",
            soft_wrap=True,
        )


@app.command("diff", cls=RobotCommand)
def diff(
    context: typer.Context,
    arguments: RobotAndFile = None,
    baud_rate: BaudRateOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Show where a robot's values differ from a file's; exit code 22 if any does.

    Only the parameters in the file are compared.
    """
    from wheelwire.parameter_file import differences, load_parameter_file

    robot, file = _split(context, arguments or ())
    wanted = load_parameter_file(file)
    with resolve(robot, as_json=as_json).open(baud_rate, bare=True) as driver:
        parameters, device = driver.parameters.list(), _device(driver)
    found = differences(parameters, wanted.values)
    absent = [p.name for p in parameters if p.name not in wanted.values]
    if as_json:
        values = {d.name: {"robot": d.robot, "file": d.file, "unit": d.unit} for d in found}
        print_json({"different": values, "not_in_file": absent, **_boards(wanted, device)})
    else:
        _print_differences(wanted, device, found, absent)
    if found:
        raise typer.Exit(DIFFERENT)


def _print_differences(
    wanted: ParameterFile,
    device: DeviceInfo | None,
    found: Sequence[Difference],
    absent: Sequence[str],
) -> None:
    from wheelwire.parameter_file import number_text

    if found:
        print_table(
            f"{len(found)} of {len(wanted.values)} values differ",
            ("name", "robot", "file", "unit"),
            [(d.name, number_text(d.robot), number_text(d.file), d.unit) for d in found],
        )
        console.print(f"robot: {_robot(device)}; file: {wanted.source}", soft_wrap=True)
    else:
        console.print(f"all {len(wanted.values)} values are equal")
    if absent:
        console.print(f"not in the file, not compared: {', '.join(absent)}", soft_wrap=True)


def _split(context: typer.Context, arguments: Sequence[str]) -> tuple[str | None, str]:
    """Split into ROBOT, if given, and FILE."""
    if not arguments:
        raise UsageError("Missing argument 'FILE'", context)
    if len(arguments) > 2:
        raise UsageError(f"Unexpected argument '{arguments[2]}'", context)
    return (arguments[0] if len(arguments) > 1 else None), arguments[-1]


def _device(driver: BaseDriver) -> DeviceInfo | None:
    return driver.info.device if isinstance(driver, DeviceDriver) else None


def _robot(device: DeviceInfo | None) -> str:
    return "an unknown board" if device is None else f"{device.board.name} {device.board_id}"


def _boards(wanted: ParameterFile, device: DeviceInfo | None) -> dict[str, object]:
    return {
        "file_board": wanted.board,
        "file_board_id": wanted.board_id,
        "robot_board": device.board if device else "",
        "robot_board_id": device.board_id if device else "",
    }


def _notes(wanted: ParameterFile, device: DeviceInfo | None) -> Iterator[str]:
    """What a person should know of where the values come from."""
    if device is None or not wanted.board_id or wanted.board_id == device.board_id:
        return
    yield f"the values of {wanted.source} are copied to {_robot(device)}"
    if wanted.board == device.board.name:
        return
    # Parameters that have a default of their own on either of the two kinds of boards.
    own = {**PLATFORM_DEFAULTS.get(device.board, {}), **_defaults_of(wanted.board)}
    copied = [name for name in own if name in wanted.values]
    if copied:
        yield (
            f"{', '.join(copied)}: the defaults of these two kinds of boards differ, "
            "check that the copied values suit this one"
        )


def _defaults_of(board: str) -> dict[str, float]:
    # The file may be of a kind of board that this release does not know.
    return PLATFORM_DEFAULTS.get(Board[board], {}) if board in Board.__members__ else {}


def _duration(*, saved: bool, lasting: bool) -> str:
    if saved:
        return "all saved"
    if lasting:
        return "until the next reset; --save keeps them"
    return "for this command only: the robot's process ended with it"
