"""ROBOT: the address of a robot, written the same way in every command."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from wheelwire.connect import (
    ADDRESS_KINDS,
    ENVIRONMENT,
    MOCK,
    driver_at,
    is_board_id,
    is_robot_file,
    named,
    open_driver,
)
from wheelwire.errors import InvalidArgument, RobotNotNamed
from wheelwire.link.ports import SerialPort, likely_boards
from wheelwire.robot.robot import Robot
from wheelwire.tools.files.robot import load_config
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from .interruptions import ended_by_a_loss, ended_by_signals
from .output import UsageError, print_note, wants_json
from .prompts import ask_yes_or_no, can_ask

_DEFAULT = f"default: ${ENVIRONMENT}, else the only board that is plugged in"


# Typer leaves out what does not begin with the text that was typed.
def complete_robot() -> Iterator[tuple[str, str]]:
    """The addresses that the shell suggests, each with a description. Opens nothing."""
    for port in likely_boards():
        yield port.device, port.note
    yield MOCK, "a simulated robot"


def complete_yaml(incomplete: str) -> Iterator[tuple[str, str]]:
    """The YAML files whose path, relative or absolute, begins with what was typed."""
    for path in sorted(glob.glob(f"{glob.escape(incomplete)}*.y*ml")):  # noqa: PTH207 - absolute
        yield path, "a file"


RobotArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="ROBOT",
        help=f"{ADDRESS_KINDS[0].upper()}{ADDRESS_KINDS[1:]}; {_DEFAULT}.",
        show_default=False,
        autocompletion=complete_robot,
    ),
]
BaudRateOption = Annotated[
    int | None,
    typer.Option(
        "--baud-rate", "--baud", help="Baud rate to try first at a port; then the usual ones."
    ),
]
YesFlag = Annotated[
    bool, typer.Option("--yes", "-y", help="Do not ask for confirmation when ROBOT is left out.")
]
ROBOT_HELP = f"ROBOT is {ADDRESS_KINDS}; {_DEFAULT}."


@dataclass(frozen=True)
class Address:
    """Where a robot can be reached.

    Attributes:
        text: As the user wrote it.
        baud_rate: Baud rate of a port; None: the default.
    """

    text: str
    baud_rate: int | None = None

    def open(self, *, bare: bool = False, drives: bool = False) -> Robot:
        """Open the robot.

        Args:
            bare: See `wheelwire.connect.driver_at`.
            drives: The command drives, so the robot is to obey its first setpoint.

        Raises:
            InvalidArgument: A baud rate was given, but the address is not a port.
            WheelwireError: As `open_driver` and `open_robot`.
        """
        from wheelwire.robot.robot import opened_to_look

        name, options = self.driver(bare=bare)
        with nullcontext() if drives else opened_to_look():
            return open_driver(name, **options)

    def open_to_look(self, *, listens: bool = True) -> Robot:
        """Open the robot for a command that only looks, stops or e-stops; changes nothing of it.

        If another program holds it and offers its link, the command is attached to that, and says
        so.

        Args:
            listens: False for a command that only stops.

        Raises:
            WheelwireError: As `open`.
        """
        from wheelwire.drivers.attached import AttachedDriver
        from wheelwire.robot.robot import opened_to_look
        from wheelwire.tools.attach import open_or_attach

        name, options = self.driver(bare=True)
        with opened_to_look():
            driver = open_or_attach(name, options, listens=listens)
        if isinstance(driver, AttachedDriver):
            holder = driver.holder
            print_note(f"attached to the link of {holder.name}, which holds {holder.port}")
        return driver

    def driver(self, *, bare: bool) -> tuple[str, dict[str, Any]]:
        """The driver's name and options; see `wheelwire.connect.driver_at`."""
        return driver_at(self.text, baud_rate=self.baud_rate, bare=bare)

    def serial_port(self) -> str:
        """The serial port to write firmware to.

        Raises:
            InvalidArgument: The address is not a serial port.
            ConfigurationError: The robot's file is invalid.
        """
        port = self.text
        if is_robot_file(port):
            robot = load_config(port)
            port = robot.serial.port if robot.driver == "serial" else robot.driver
            # It may mean several ports, and the chip must be written to before it can report its
            # id.
            port = robot.serial.board_id or port
        # A chip's boot ROM does not answer on any of these.
        elsewhere = is_board_id(port) or port.startswith(("socket:", "unix:"))
        if elsewhere or port in (MOCK, "l298n", "pigpio"):
            raise InvalidArgument(
                f"{self.text} is not a serial port: give the port that the board is plugged in to "
                "(`wheelwire ports` lists them)"
            )
        return port

    def parameters(self) -> Collection[str]:
        """The parameters that a robot file sets in each session, and so need not be saved.

        Raises:
            ConfigurationError: The robot's file is invalid.
        """
        return load_config(self.text).parameters if is_robot_file(self.text) else ()

    def check_parameters(self, names: Collection[str], *, save: bool) -> None:
        """Check that a change of parameters would last.

        Raises:
            InvalidArgument: It would not be saved anywhere, or the robot's file would undo it.
            ConfigurationError: The robot's file is invalid.
        """
        if self.text == MOCK and save:
            raise InvalidArgument(
                "mock exists only while this command runs and cannot save parameters: leave out "
                "--save, or start `wheelwire sim` and give its port"
            )
        if not is_robot_file(self.text):
            return
        robot = load_config(self.text)
        if robot.driver != "serial":
            # What its store has saved overrides the values in the file.
            if save and robot.store is None:
                raise InvalidArgument(
                    f"{self.text} does not say where this robot saves its parameters: "
                    "add `store: FILE` to it"
                )
            return
        for name in names:
            if name in robot.parameters:
                raise InvalidArgument(
                    f"{self.text} sets {name} each time the robot is opened: change it in that file"
                )


@contextmanager
def driving(address: Address, then: Callable[[], str] = str) -> Iterator[Robot]:
    """A robot that the block drives: what ends the block early stops it, and is explained.

    Args:
        address: Where it is.
        then: As of `Ending.stops`.
    """
    # In this order: the signals are still handled while the driver stops the robot.
    with (
        ended_by_signals() as ending,
        address.open(drives=True) as robot,
        ending.stops(robot, then),
        ended_by_a_loss(),
    ):
        yield robot


def outlives_commands(driver: Robot) -> bool:
    """Whether the robot's core keeps running after `close`, with its e-stop and parameters."""
    from wheelwire.drivers.serial import SerialDriver

    # The other built-in drivers start the core's process themselves, and end it.
    return isinstance(driver, SerialDriver)


@dataclass(frozen=True)
class Given:
    """What the command line says of the robot: ROBOT, by itself or in a list, and --baud-rate."""

    robot: str | None = None
    baud_rate: int | None = None
    arguments: Sequence[str] | None = None
    context: typer.Context | None = None

    @staticmethod
    def on_command_line(listed: Any = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """Arguments and options; `listed` is the argument that may begin with ROBOT."""
        arguments: dict[str, Any] = {"robot": RobotArgument}
        if listed is not None:
            several = Annotated[list[str] | None, listed]
            arguments = {"context": typer.Context, "arguments": several}
        return arguments, {"baud_rate": BaudRateOption}

    def split(self, *names: str) -> tuple[Given, list[str]]:
        """ROBOT, if given, and the values of all `names` that follow it. Nothing is opened."""
        arguments = self.arguments or ()
        for argument in arguments:
            if argument.startswith("--"):
                raise UsageError(f"No such option: {argument}", self.context)
        missing = len(names) - len(arguments)
        # A file may have any name. A parameter's name means that the last argument is missing.
        if missing == 0 and names != ("FILE",) and looks_like_address(arguments[0]):
            missing = 1
        if missing > 0:
            raise UsageError(f"Missing argument '{names[-missing]}'", self.context)
        # One argument more than names is ROBOT.
        if missing < -1:
            raise UsageError(f"Unexpected argument '{arguments[len(names) + 1]}'", self.context)
        robot = arguments[0] if len(arguments) > len(names) else None
        return Given(robot, self.baud_rate), list(arguments[-len(names) :])

    def named(self) -> Address | None:
        """The robot that ROBOT or else $WHEELWIRE_ROBOT names, if one of them does.

        Raises:
            InvalidArgument: ROBOT is empty.
        """
        text = os.environ.get(ENVIRONMENT) if self.robot is None else named(self.robot)
        return Address(text, self.baud_rate) if text else None

    def resolve(self, *, moves: bool = False, yes: bool = False) -> Address:
        """The robot to use: the one named, else the only likely board.

        Args:
            moves: The command moves the wheels or allows it: ask first if no robot was named.
            yes: Do not ask.

        Raises:
            InvalidArgument: ROBOT is empty.
            RobotNotNamed: There is no likely board, or several; or the user did not confirm.
        """
        # With --json, stderr carries JSON errors: print nothing else there except the question.
        if (address := self.named()) is not None:
            if self.robot is None and moves and not wants_json():
                # The name is not on this command line: tell which robot is about to move.
                print_note(f"using {address.text}, named by {ENVIRONMENT}")
            return address
        port = _only_candidate()
        chosen = f"no robot was named; {port.device} is the only candidate ({port.note})"
        if moves and not yes:
            _confirm(port.device, chosen)
        elif not wants_json():
            print_note(chosen)
        return Address(port.device, self.baud_rate)


def _only_candidate() -> SerialPort:
    found = likely_boards()
    if not found:
        raise RobotNotNamed(
            "no robot was named, and no board was found: plug it in with a data cable (many cables "
            "only charge) and check that `wheelwire ports` lists it; or name the robot: "
            f"{ADDRESS_KINDS}, as the first argument or in {ENVIRONMENT}"
        )
    if len(found) > 1:
        listed = ", ".join(f"{port.device} ({port.note})" for port in found)
        raise RobotNotNamed(
            f"no robot was named, and several ports may be one: {listed}; name one, "
            f"as the first argument or in {ENVIRONMENT}"
        )
    return found[0]


def _confirm(device: str, chosen: str) -> None:
    if not can_ask():
        raise RobotNotNamed(
            f"{chosen}, and there is no terminal to ask on: name the robot, "
            f"as the first argument or in {ENVIRONMENT}, or give --yes"
        )
    if not ask_yes_or_no(f"{chosen}. Its wheels may move. Continue?"):
        raise RobotNotNamed(f"{device} was not used: name the robot")


def looks_like_address(text: str) -> bool:
    """Whether `text` must be ROBOT, in a place where a parameter's name is possible too."""
    # A parameter's name is one even where a file is called the same.
    return text not in PARAMETER_BY_NAME and (
        text == MOCK
        or is_board_id(text)
        or any(sign in text for sign in "/:.")
        or Path(text).exists()
    )


def is_port(text: str) -> bool:
    """Whether `text` can only be ROBOT, in a place where a file is expected."""
    path = Path(text)
    if text == MOCK or text.startswith(("socket:", "unix:")) or is_board_id(text):
        return True
    # Also a port that is not plugged in now.
    is_missing_device = text.startswith("/dev/") and not path.exists()
    return is_missing_device or path.is_char_device() or path.is_block_device() or path.is_socket()
