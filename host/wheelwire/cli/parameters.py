"""`wheelwire params`: list, get, set, save, reset; export, import and diff of whole files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated, Any, TypeAlias, cast

import typer
import typer.core
from rich.padding import Padding

from wheelwire.errors import InvalidArgument, OutputFailed, WheelwireError
from wheelwire.link.info import DeviceInfo
from wheelwire.parameters import ParameterInfo, differences, number_text
from wheelwire.robot.robot import Robot
from wheelwire.tools.files.parameters import ParameterFile, load_parameter_file
from wheelwire.tools.files.state import state_folder
from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, PLATFORM_DEFAULTS

from .address import (
    ROBOT_HELP,
    Given,
    complete_robot,
    complete_yaml,
    looks_like_address,
    outlives_commands,
)
from .interruptions import ended_by_signals
from .output import (
    console,
    print_json,
    print_lines,
    print_note,
    print_result,
    print_table,
    printed_json,
    show_help_alone,
    wants_json,
    write_new,
)
from .prompts import ask_yes_or_no, can_ask
from .registry import Commands, Heading, command

_FLASH_FAULTS = Fault.STORE_FULL | Fault.STORE_UNREADABLE
DIFFERENT = 22
"""Exit code of `params diff` if values differ."""
TABLE_COLUMNS = 100
"""Narrower terminals get a list in place of a table."""

Complete: TypeAlias = Callable[[str], Iterable[tuple[str, str]]]
"""What the shell suggests for what was typed, each with a description."""

app = Commands()
command("params", Heading.BUILD, 7, page="robot-file")(app)


class RobotCommand(typer.core.TyperCommand):
    """A command whose usage line shows the metavars of its arguments unchanged."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:  # noqa: ARG002 - Click's signature
        """The usage without the brackets and dots that some releases of Typer add."""
        arguments = (p for p in self.params if p.param_type_name == "argument")
        return [self.options_metavar or "", *(str(argument.metavar) for argument in arguments)]


def robot_and(what: str, help_text: str, complete: Complete = lambda _: ()) -> Any:
    """ROBOT, which may be left out, and what comes after it, as one list for Click."""

    def complete_any(incomplete: str) -> Iterator[tuple[str, str]]:
        yield from complete_robot()
        yield from complete(incomplete)

    return typer.Argument(
        metavar=f"[ROBOT] {what}",
        help=f"{ROBOT_HELP} {help_text}",
        show_default=False,
        autocompletion=complete_any,
    )


def _robot_and_names(what: str) -> Any:
    help_text = "`wheelwire params list` shows the names."
    return robot_and(
        what, help_text, lambda _: ((p.name, p.doc) for p in PARAMETER_BY_NAME.values())
    )


@app.callback(invoke_without_command=True)
def params(context: typer.Context) -> None:
    """Show and change the robot's parameters."""
    show_help_alone(context)


@app.command("list")
def list_all(given: Given) -> None:
    """List all parameters with value, unit, bounds and meaning."""
    # Bare: with a robot's file the values on the robot are shown, not replaced by the file's.
    with given.resolve().open_to_look() as driver:
        parameters = driver.parameters.list()
    if printed_json(parameters):
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
def get(given: Annotated[Given, _robot_and_names("NAME")]) -> None:
    """Show one value."""
    given, (name,) = given.split("NAME")
    with given.resolve().open_to_look() as driver:
        value = driver.parameters[name]
    print_result({name: value}, f"{value:g}")


# Unknown options are ignored, so that a negative VALUE is not mistaken for one; `split` rejects
# what really is an option.
@app.command("set", cls=RobotCommand, context_settings={"ignore_unknown_options": True})
def set_value(given: Annotated[Given, _robot_and_names("NAME VALUE")], save: bool = False) -> None:
    """Change one value until the next reset; with --save also after it. Saves no other value.

    Args:
        given: The robot.
        save: Save this value, too.
    """
    given, (name, value) = given.split("NAME", "VALUE")
    address = given.resolve()
    address.check_parameters([name], save=save)
    with address.open() as driver:
        lasting = outlives_commands(driver)
        in_force = driver.parameters.set(name, _number(value))
        if save:
            driver.parameters.save(name)
    duration = _duration(name, address.text, saved=save, lasting=lasting)
    text = f"{name} = {in_force:g}, {duration}"
    print_result({name: in_force, "saved": save}, text)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return cast("float", text)  # the parameter's own check then says what is allowed


def _duration(name: str, address: str, *, saved: bool, lasting: bool) -> str:
    """How long a value applies. `lasting`: the robot's core keeps running after this command."""
    if not lasting:
        return "saved" if saved else "for this command only: the robot's process ended with it"
    if not PARAMETER_BY_NAME[name].after_reset:
        return "saved" if saved else "until the next reset; --save keeps it"
    restart = f"`wheelwire restart {address}`"
    if saved:
        return f"saved; takes effect at the next start: {restart}"
    return (
        f"no effect: it acts only from the next start, and is lost then; use --save, then {restart}"
    )


@app.command("save", cls=RobotCommand)
def save_values(given: Annotated[Given, _robot_and_names("[NAME]...")]) -> None:
    """Save the parameters named, or all.

    The first argument is ROBOT if it is `mock`, an existing file or contains / : or a dot;
    otherwise a parameter.
    """
    names = list(given.arguments or ())
    robot = names.pop(0) if names and looks_like_address(names[0]) else None
    address = Given(robot, given.baud_rate).resolve()
    address.check_parameters(names, save=True)
    with address.open() as driver:
        for name in names:
            driver.parameters[name]  # raises for an unknown name before anything is saved
        for wanted in names or (None,):
            driver.parameters.save(wanted)
        # Read again: they are shown as the robot has them.
        listed = {p.name: p for p in driver.parameters.list()}
    kept = {name: listed[name] for name in names} if names else listed
    shown = [p for p in kept.values() if names or p.value != p.default]
    values = ", ".join(f"{p.name} = {p.value:g}" for p in shown)
    text = f"all values saved; different from their defaults: {values or 'none'}"
    if names:
        text = f"saved: {values}"
    saved = {name: p.value for name, p in kept.items()}
    print_result({"saved": saved}, text)


@app.command("reset")
def reset_all(
    given: Given,
    copy: Annotated[Path | None, typer.Option(show_default=False)] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y")] = False,
) -> None:
    """Reset all parameters to their defaults, the saved ones included.

    Writes a copy of the present values first, for `params import`. If the flash cannot be opened
    (STORE_FULL, STORE_UNREADABLE) this erases the board, too: then nothing drives until `wheelwire
    board write`.

    Args:
        given: The robot.
        copy: The copy; default: a new file in ~/.local/state/wheelwire.
        yes: Do not ask.
    """
    address = given.resolve()
    # Before the robot is opened, which stops it.
    if not yes and not can_ask():
        raise InvalidArgument(
            "`params reset` asks first, and there is no terminal to ask on: add --yes. Nothing was "
            "reset"
        )
    # Bare: the copy is of what the robot has, not of what its file would set.
    with ended_by_signals() as ending, address.open(bare=True) as driver:
        ending.outcome = "interrupted; nothing was reset"
        present, device = driver.parameters.list(), _device(driver)
        if not yes and not ask_yes_or_no(_reset_question(present, driver.read().faults)):
            raise InvalidArgument("nothing was reset")
        file = _write_copy(ParameterFile.of_robot(present, device), copy)
        back = (
            f"`wheelwire params import {address.text} {file} --save` restores the previous values"
        )
        ending.outcome = f"interrupted; {back}"
        try:
            driver.parameters.reset()
        except WheelwireError:
            print_note(f"a copy of the values is in {file}")
            raise
    text = f"all parameters reset to their defaults; {back}"
    print_result({"reset": True, "copy": str(file)}, text)


def _reset_question(present: Sequence[ParameterInfo], faults: Fault) -> str:
    changed = [p.name for p in present if p.value != p.default]
    values = f"{len(changed)} values differ from their defaults"
    if len(changed) == 1:
        values = f"{changed[0]} differs from its default"
    text = f"{values}; what is saved is reset, too. "
    if damaged := faults & _FLASH_FAULTS:
        names = " and ".join(str(fault.name) for fault in Fault if fault in damaged)
        text += (
            f"{names}: if the flash cannot be opened, this erases the board, too; then nothing "
            "drives until `wheelwire board write`. "
        )
    return f"{text}Reset all parameters?"


def _write_copy(values: ParameterFile, file: Path | None) -> Path:
    """Write a file that is new; returns its path.

    Raises:
        OutputFailed: It exists, or cannot be written.
    """
    reset = "nothing was reset: name another file with --copy"
    with OutputFailed.of(file, reset):
        try:
            file = file or _new_copy(values.board_id)
            write_new(file, values.text().encode())
        except FileExistsError as error:
            raise OutputFailed(f"{file or error.filename} exists; {reset}") from error
    return file


def _new_copy(board_id: str) -> Path:
    from wheelwire.log.recorder import free_path  # here: no other command on values records

    folder = state_folder()
    folder.mkdir(parents=True, exist_ok=True)
    now = datetime.now(timezone.utc)
    return free_path(folder / f"params-{board_id or 'unknown'}-{now:%Y%m%d-%H%M%S}.yaml")


RobotAndFile = Annotated[
    Given, robot_and("FILE", "FILE is one that `wheelwire params export` wrote.", complete_yaml)
]


@app.command("export")
def export(given: Given) -> None:
    """Print all parameters with their units, and the board's identity, as YAML.

    `params import` sets them on another robot.
    """
    with given.resolve().open_to_look() as driver:
        exported = ParameterFile.of_robot(driver.parameters.list(), _device(driver))
    if not printed_json(exported.as_mapping()):
        typer.echo(exported.text(), nl=False)


@app.command("import", cls=RobotCommand)
def import_file(given: RobotAndFile, save: bool = False) -> None:
    """Set all values in a file until the next reset; with --save also after it.

    If the robot refuses one or the link fails, its previous values return. The file may be from
    another board.

    Args:
        given: The robot and the file.
        save: Save these values, too.
    """
    # The file first: opening the robot stops it, which a wrong file should not do.
    given, (file,) = given.split("FILE")
    wanted = load_parameter_file(file)
    address = given.resolve()
    # Whether anything can be saved is known before the robot is opened. Which values would change,
    # and whether the robot's file would undo them, is known only then.
    address.check_parameters([], save=save)
    with ended_by_signals() as ending, address.open() as driver:
        ending.outcome = "interrupted; the previous values are set again"
        lasting, device = outlives_commands(driver), _device(driver)
        expected = differences(driver.parameters.list(), wanted.values)
        address.check_parameters([change.name for change in expected], save=save)
        changes = driver.parameters.set_all(wanted.values, save=save)
        ending.outcome = "interrupted; the values in the file are set"
        driver.read()  # it may have been sent before the last change
        state = driver.read().state
    if printed_json(
        {
            "changed": {change.name: change.wanted for change in changes},
            "saved": save,
            "state": state,
            **_boards(wanted, device),
        }
    ):
        return
    print_lines(
        *_notes(wanted, device),
        *(
            f"{change.name}: {number_text(change.robot)} -> "
            f"{number_text(change.wanted)} {change.unit}".rstrip()
            for change in changes
        ),
    )
    print_lines(
        f"{len(changes)} of {len(wanted.values)} values changed, "
        f"{_file_duration(saved=save, lasting=lasting)}"
    )
    # A core that ends with this command is never reset.
    after_reset = [c.name for c in changes if PARAMETER_BY_NAME[c.name].after_reset]
    if after_reset and lasting:
        act = "takes effect" if len(after_reset) == 1 else "take effect"
        unsaved = "" if save else ", and only if saved"
        console.print(f"{', '.join(after_reset)} {act} after the next reset{unsaved}")
    if state is SupervisorState.ESTOPPED:
        print_lines(
            "an e-stop is latched: with estop_input_enabled 1 an open contact latches it; "
            f"`wheelwire clear {address.text}` ends it once the contact is closed"
        )


@app.command("diff", cls=RobotCommand)
def diff(given: RobotAndFile) -> None:
    """Show where a robot's values differ from a file's; exit code 22 if any does.

    Only the parameters in the file are compared.
    """
    given, (file,) = given.split("FILE")
    wanted = load_parameter_file(file)
    with given.resolve().open_to_look() as driver:
        parameters, device = driver.parameters.list(), _device(driver)
    found = differences(parameters, wanted.values)
    absent = [p.name for p in parameters if p.name not in wanted.values]
    if wants_json():
        values = {d.name: {"robot": d.robot, "file": d.wanted, "unit": d.unit} for d in found}
        print_json({"different": values, "not_in_file": absent, **_boards(wanted, device)})
    elif found:
        print_table(
            f"{len(found)} of {len(wanted.values)} values differ",
            ("name", "robot", "file", "unit"),
            [(d.name, number_text(d.robot), number_text(d.wanted), d.unit) for d in found],
        )
        print_lines(f"robot: {_robot(device)}; file: {wanted.source}")
    else:
        console.print(f"all {len(wanted.values)} values are equal")
    if absent and not wants_json():
        print_lines(f"not in the file, not compared: {', '.join(absent)}")
    if found:
        raise typer.Exit(DIFFERENT)


def _device(driver: Robot) -> DeviceInfo | None:
    return driver.info.device if driver.has_device else None


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
    """Warnings for a person about where the values come from."""
    if device is None or not wanted.board_id or wanted.board_id == device.board_id:
        return
    yield f"the values of {wanted.source} are copied to {_robot(device)}"
    if wanted.board == device.board.name:
        return
    # Parameters that have a default of their own on either of the two kinds of boards. The file
    # may be of a kind of board that this release does not know.
    defaults = {chip.name: values for chip, values in PLATFORM_DEFAULTS.items()}
    own = {**defaults.get(device.board.name, {}), **defaults.get(wanted.board, {})}
    copied = [name for name in own if name in wanted.values]
    if copied:
        yield (
            f"{', '.join(copied)}: the defaults of these two kinds of boards differ, "
            "check that the copied values suit this one"
        )


def _file_duration(*, saved: bool, lasting: bool) -> str:
    if saved:
        return "all saved"
    if lasting:
        return "until the next reset; --save keeps them"
    return "for this command only: the robot's process ended with it"
