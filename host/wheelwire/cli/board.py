"""`wheelwire board`: boards as data: which pins lead to which power stage and encoders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from wheelwire.board import Configuration, WheelPins, chip_of_pins, sentence
from wheelwire.errors import ConfigurationError, DeviceRefused, InvalidArgument
from wheelwire.robot.robot import Robot
from wheelwire.tools.files.board import (
    ANY_MODULE,
    CHIP_BY_NAME,
    MODULE_BY_NAME,
    STAGE_BY_NAME,
    board_mapping,
    checked_board,
    load_board,
    reported,
    shipped_boards,
    to_yaml,
)
from wheelwire.tools.files.peripherals import peripheral_sections
from wheelwire_protocol.board import (
    CHIPS,
    MODULES,
    WARNINGS,
    BoardFault,
    BoardLine,
    BoardPin,
    EncoderPulls,
)
from wheelwire_protocol.codes import ConfigurationState, RefusalCode
from wheelwire_protocol.core import check_board
from wheelwire_protocol.power_stages import OUTPUTS, STAGES, Action, Level, Stage

from .address import Given, complete_yaml, is_port
from .output import (
    check_writable,
    console,
    print_json,
    print_lines,
    print_result,
    print_table,
    printed_json,
    show_help_alone,
    wants_json,
    write_new,
)
from .parameters import RobotCommand, robot_and
from .prompts import ask, ask_until, ask_yes_or_no, can_ask
from .registry import Commands, Heading, command

app = Commands()
command("board", Heading.BUILD, 4, page="boards")(app)


def _complete(incomplete: str) -> Iterator[tuple[str, str]]:
    for name in shipped_boards():
        yield name, "a built-in board"
    yield from complete_yaml(incomplete)


def _board_argument(metavar: str, help_text: str) -> Any:
    return typer.Argument(
        metavar=metavar, help=help_text, autocompletion=_complete, show_default=False
    )


@app.callback(invoke_without_command=True)
def board(context: typer.Context) -> None:
    """Show, check and write boards: pins, power stage and encoders as data."""
    show_help_alone(context)


@app.command("list")
def list_all() -> None:
    """List the built-in boards."""
    boards = {name: load_board(name) for name in shipped_boards()}
    rows = [
        (name, one.name, CHIPS[one.chip].name, one.stage.name.lower(), STAGES[one.stage].parts)
        for name, one in boards.items()
    ]
    if wants_json():
        keys = ("name", "title", "chip", "stage")
        print_json([dict(zip(keys, row, strict=False)) for row in rows])
        return
    print_table("Boards", ("name", "board", "chip", "stage", "for"), rows)


@app.command("show")
def show(
    name: Annotated[
        str, _board_argument("NAME", "A built-in board (`wheelwire board list`), or a file.")
    ],
) -> None:
    """Show what is connected to which pin, and what the power stage does."""
    _refuse_port(name)
    _show(load_board(name))


def _show(found: Configuration) -> None:
    if printed_json(board_mapping(found)):
        return
    stage = STAGES[found.stage]
    print_table(
        f"{found.name}, {CHIPS[found.chip].name}",
        ("function", "GPIO", "to ground"),
        [
            (function.doc, pin, "10 kOhm" if pin in found.pulldowns else "")
            for function, pin in found.wiring()
        ],
    )
    if found.peripherals:
        _show_peripherals(found)
    inputs = [name for name in OUTPUTS if name in stage.inputs]
    print_table(
        f"{found.stage.name.lower()}: {stage.parts}",
        ("", *inputs),
        [
            (action.value, *(stage.rows[action].get(name, Level.KEEP).value for name in inputs))
            for action in Action
        ],
    )
    for what in ("coast", "brake", "release", "dead_time"):
        console.print(f"{what.replace('_', ' ')}: {getattr(stage, what)}")


def _show_peripherals(found: Configuration) -> None:
    rows = peripheral_sections(found.peripherals)
    for group in ("inputs", "ranges"):
        rows |= {f"{group}.{name}": each for name, each in rows.pop(group, {}).items()}
    print_table(
        "peripherals",
        ("section", "connected to"),
        [
            (name, ", ".join(f"{key} {value}" for key, value in content.items()))
            for name, content in rows.items()
        ],
    )


@app.command("check")
def check(
    file: Annotated[str, _board_argument("FILE", "A file, or a built-in board's name.")],
) -> None:
    """Check a board by the firmware's own rules; exit code 15 if it cannot be used."""
    _refuse_port(file)
    found = load_board(file)
    problems, warnings = found.problems(), found.warnings()
    if not printed_json({"board": found.name, "problems": problems, "warnings": warnings}):
        verdict = [] if problems else ["nothing is wrong with this board"]
        lines = (*problems, *(f"warning: {warning}" for warning in warnings), *verdict)
        print_lines(*(f"{file}: {line}" for line in lines))
    if problems:
        raise typer.Exit(ConfigurationError.exit_code)


def _refuse_port(given: str) -> None:
    if is_port(given):
        raise InvalidArgument(
            f"{given} is a ROBOT, not a board: give a board's file or name; "
            f"`wheelwire board read {given}` shows the one that the robot is on"
        )


@app.command("write", cls=RobotCommand)
def write(
    given: Annotated[
        Given, robot_and("FILE", "FILE is a board's file, or a built-in board's name.", _complete)
    ],
) -> None:
    """Store a board and its peripherals, restart the device, and keep them if it comes back.

    On trial nothing drives, and the previous ones return after 10 s.
    """
    # One list: Click cannot leave out the first of two arguments.
    given, (name,) = given.split("FILE")
    if is_port(name):
        raise InvalidArgument(
            f"{name} is a ROBOT, not a board: give ROBOT first, as in "
            f"`wheelwire board write {name} {given.robot or 'FILE'}`"
        )
    # Before the robot is opened, which stops it: a board that cannot be used costs nothing.
    wanted = checked_board(name)
    # Bare: a robot's file may name this board, on which the device is not yet.
    address = given.resolve()
    with address.open(bare=True) as opened:
        driver = _with_a_board(opened)
        try:
            driver.board.take_up(wanted)
        except DeviceRefused as error:
            fits = wanted.chip is chip_of_pins(driver.info.device.board)
            if fits or error.code != RefusalCode.BOARD_REFUSED:
                raise
            hint = f"{wanted.name} is for the {wanted.chip.name}, not for this chip"
            raise error.hinted("the board", hint) from error
    text = f"{wanted.name}: written, tried and confirmed"
    print_result({"board": wanted.name, "written": True}, text)


@app.command("confirm")
def confirm(given: Given, yes: bool = False) -> None:
    """Confirm the board and the peripherals that a device reports, and let it drive.

    New firmware assumes the board that came with it, and drives nothing until somebody confirms it.

    Args:
        given: The robot.
        yes: Do not ask: the robot is on the board that it names.
    """
    with given.resolve().open(bare=True) as driver:
        board = _with_a_board(driver).board
        state, found = board.read()
        if found is None:
            raise ConfigurationError(
                "the device has no board that could be confirmed: write one with "
                "`wheelwire board write`"
            )
        is_new = state is not ConfigurationState.STORED
        if is_new:
            _ask_to_confirm(found, yes=yes)
            board.accept(found)
    print_result(
        {"board": found.name, "confirmed": True, "was_confirmed": not is_new},
        f"{found.name}: confirmed{'; the robot drives' if is_new else ' already'}",
    )


def _ask_to_confirm(found: Configuration, *, yes: bool) -> None:
    if yes:
        return
    if not can_ask():
        raise InvalidArgument(
            f"the device reports the board {found.name}; compare it with `wheelwire board read`, "
            "then confirm with --yes: there is no terminal to ask on"
        )
    if not wants_json():
        _show(found)
    question = f"Is the robot wired like this, to {found.name}? If not, its wheels may run away."
    if not ask_yes_or_no(question, default=False):
        raise ConfigurationError(
            f"{found.name} was not confirmed, and nothing drives: write the board that is there "
            "with `wheelwire board write`"
        )


@app.command("read")
def read(given: Given) -> None:
    """Show the device's active board and peripherals, as a file."""
    with given.resolve().open_to_look() as driver:
        board = _with_a_board(driver).board
        state, found = board.read()
    if printed_json({"state": state, "board": board_mapping(found) if found else None}):
        return
    typer.echo(reported(state, found), nl=False)


def _with_a_board(driver: Robot) -> Robot:
    if not driver.has_device:
        raise InvalidArgument(
            "this robot's driver has no device that could store a board: name a robot that has one"
        )
    return driver


@app.command("init")
def init(
    file: Annotated[Path, typer.Argument(metavar="[FILE]", show_default=True)] = Path("board.yaml"),
    like: str | None = None,
) -> None:
    """Ask for the pins of a board, check each, and write a file.

    Exit code 15 if the board cannot be used as it is.

    Args:
        file: The file to write.
        like: A built-in board or a file whose pins are the defaults.
    """
    # Before the questions, whose answers would be lost.
    if file.exists():
        raise ConfigurationError(f"{file} exists: choose another name, or remove it first")
    check_writable(file)
    made = _ask_for_board(like)
    problems = made.problems()
    try:
        # New: it may have appeared while the questions were answered.
        write_new(file, to_yaml(made).encode())
    except OSError as error:
        raise ConfigurationError(f"{file}: {error.strerror}") from error
    if not printed_json({"file": str(file), "board": board_mapping(made), "problems": problems}):
        print_lines(*(f"{file}: {problem}" for problem in problems))
        look = "`wheelwire board show"
        if problems:
            look = "correct it, then run `wheelwire board check"
        print_lines(f"written: {file}; {look} {file}`")
    if problems:
        raise typer.Exit(ConfigurationError.exit_code)


def _ask_for_board(like: str | None) -> Configuration:
    base = load_board(like) if like else None
    # Questions and hints go to standard error: with --json, standard output is the result alone.
    for stage, table in STAGES.items():
        typer.echo(f"{stage.name.lower()}: {table.parts}", err=True)
    chip = CHIP_BY_NAME[
        _choose("chip", list(CHIP_BY_NAME), CHIPS[base.chip].name if base else "esp32")
    ]
    default_stage = base.stage if base else Stage.ENABLE_IN1_IN2
    stage = STAGE_BY_NAME[_choose("stage", list(STAGE_BY_NAME), default_stage.name.lower())]
    name = ask("name", base.name if base else None)
    made = Configuration(name, chip, stage, WheelPins(), WheelPins(), encoder_filter_ns=1000)
    made = _ask_for_module(made, base)
    if base is not None:
        made = replace(
            made,
            pwm_frequency_hz=base.pwm_frequency_hz,
            encoder_pulls=base.encoder_pulls,
            encoder_filter_ns=base.encoder_filter_ns,
            battery_divider=base.battery_divider,
            estop_contact=base.estop_contact,
            peripherals=base.peripherals,
        )
    question = "Do the chip's own pull-ups hold the encoders' outputs?"
    internal = made.encoder_pulls is EncoderPulls.INTERNAL
    internal = ask_yes_or_no(question, default=internal)
    made = replace(
        made,
        # The stage that was chosen may be slower than the one that the frequency was meant for.
        pwm_frequency_hz=min(made.pwm_frequency_hz, STAGES[stage].max_frequency_hz),
        encoder_pulls=EncoderPulls.INTERNAL if internal else EncoderPulls.EXTERNAL,
    )
    wanted = [*STAGES[stage].inputs, "encoder_a", "encoder_b"]
    for side in ("left", "right"):
        for pin in wanted:
            made = _ask_for_pin(made, BoardPin[f"{side}_{pin}".upper()], base)
    # These are asked for only where the stage or the chip has a use for them.
    optional = [BoardPin.STANDBY] if STAGES[stage].has_standby else []
    optional += [BoardPin.ESTOP]
    optional += [BoardPin.LED] if CHIPS[chip].has_led else []
    optional += [BoardPin.BATTERY] if CHIPS[chip].adc else []
    for function in optional:
        made = _ask_for_pin(made, function, base, optional=True)
    if made.battery is not None:
        made = replace(made, battery_divider=_ask_for_divider(made.battery_divider))
    # Only a chip with native USB leaves a choice.
    likely = base.line if base else BoardLine.UART
    if CHIPS[chip].usb and _choose("link", ["uart", "usb"], likely.name.lower()) == "usb":
        made = replace(made, line=BoardLine.USB)
    # Last: it is about the pins that were given.
    return _ask_for_pull_downs(made, base)


def _ask_for_module(made: Configuration, base: Configuration | None) -> Configuration:
    """Ask what carries the chip, if modules with different pins do."""
    names = [
        name for name, m in MODULE_BY_NAME.items() if m in MODULES and MODULES[m].chip is made.chip
    ]
    if not names:
        return made
    for name in names:
        typer.echo(f"{name}: {MODULE_BY_NAME[name].doc}", err=True)
    likely = MODULES[base.module].name if base and base.module in MODULES else ANY_MODULE
    answer = _choose("module", [ANY_MODULE, *names], likely if likely in names else ANY_MODULE)
    return replace(made, module=MODULE_BY_NAME[answer])


def _ask_for_divider(default: float) -> float:
    def parse(given: str) -> float:
        try:
            return float(given)
        except ValueError:
            raise InvalidArgument("give a number") from None

    return ask_until("battery volts per volt at the pin", parse, default)


def _ask_for_pin(
    made: Configuration, function: BoardPin, base: Configuration | None, *, optional: bool = False
) -> Configuration:
    """Ask until the pin can be used, or is left out."""
    default = base.pin(function) if base else None
    prompt = f"{function.doc}: GPIO" + (", - for none" if optional else "")
    while True:
        text = ask(prompt, "-" if optional and default is None else default)
        if optional and text.strip() == "-":
            return made
        if not text.strip().isdecimal() or int(text) > 63:
            typer.echo("give the number of a GPIO", err=True)
            continue
        tried = _with_pin(made, function, int(text))
        problems, warnings = _issues_of(tried, function)
        for text in (*problems, *(f"warning: {warning}" for warning in warnings)):
            typer.echo(text, err=True)
        if not problems:
            return tried
        # Not offered again: Enter would only repeat the mistake.
        default = None


def _with_pin(made: Configuration, function: BoardPin, pin: int) -> Configuration:
    # Without a side the whole name is in `side`: STANDBY is the board's attribute `standby`.
    side, _, name = function.name.lower().partition("_")
    if side not in ("left", "right"):
        return replace(made, **{side: pin})  # type: ignore[arg-type]
    wheel = replace(getattr(made, side), **{name: pin})
    return replace(made, **{side: wheel})


def _issues_of(made: Configuration, function: BoardPin) -> tuple[list[str], list[str]]:
    """Problems and warnings of this pin; later, `check` reports missing and unheld pins."""
    later = (BoardFault.PIN_MISSING, BoardFault.NO_PULL_DOWN, BoardFault.PIN_PULLED_UP)
    found: tuple[list[str], list[str]] = ([], [])
    for issue in check_board(made.packed()):
        if issue.pin >= 0 and issue.function == function and issue.fault not in later:
            found[issue.fault in WARNINGS].append(sentence(issue, made.chip, made.stage))
    return found


def _ask_for_pull_downs(made: Configuration, base: Configuration | None) -> Configuration:
    missing = (BoardFault.NO_PULL_DOWN, BoardFault.PIN_PULLED_UP)
    for issue in check_board(made.packed()):
        if issue.fault not in missing:
            continue
        where = f"{issue.function.doc}, GPIO {issue.pin}"
        question = f"Is there a resistor of 10 kOhm from {where}, to ground?"
        fitted = base is not None and issue.pin in base.pulldowns
        if ask_yes_or_no(question, default=fitted):
            made = replace(made, pulldowns=made.pulldowns | {issue.pin})
    return made


def _choose(what: str, choices: list[str], default: str) -> str:
    def parse(given: str) -> str:
        if given not in choices:
            raise InvalidArgument(f"choose one of {', '.join(choices)}")
        return given

    return ask_until(f"{what} ({', '.join(choices)})", parse, default)
