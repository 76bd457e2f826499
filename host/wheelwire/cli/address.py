"""ROBOT: the one address of a robot, the same in every command that talks to one."""

from __future__ import annotations

import os
import sys
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wheelwire.errors import InvalidArgument, RobotNotNamed
from wheelwire.link.port_list import SerialPort, likely_boards
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

if TYPE_CHECKING:
    from wheelwire.config import RobotConfig
    from wheelwire.drivers.base import BaseDriver

ENVIRONMENT = "WHEELWIRE_ROBOT"
MOCK = "mock"
KINDS = "a port, socket://HOST:PORT, unix:PATH, a robot's YAML file or mock"
_FILES = (".yaml", ".yml")
_LEFT_OUT = f"default: ${ENVIRONMENT}, else the only board that is plugged in"


def complete_robot(incomplete: str) -> Iterator[tuple[str, str]]:
    """The addresses that a shell can offer, with what each may be. Nothing is opened."""
    found = [(port.device, port.note) for port in likely_boards()]
    for address, meaning in (*found, (MOCK, "a simulated robot")):
        if address.startswith(incomplete):
            yield address, meaning


def complete_robot_or_name(incomplete: str) -> Iterator[tuple[str, str]]:
    """For an argument that may be ROBOT or the name of a parameter."""
    yield from complete_robot(incomplete)
    for name, parameter in PARAMETER_BY_NAME.items():
        if name.startswith(incomplete):
            yield name, parameter.doc


RobotArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="ROBOT",
        help=f"{KINDS[0].upper()}{KINDS[1:]}; {_LEFT_OUT}.",
        show_default=False,
        autocompletion=complete_robot,
    ),
]
BaudOption = Annotated[
    int | None, typer.Option(help="Of a port: tried first; then the usual rates.")
]
YesFlag = Annotated[
    bool, typer.Option("--yes", "-y", help="Do not ask, though the robot was not named.")
]
LEFT_OUT_HELP = f"ROBOT is {KINDS}; {_LEFT_OUT}."


@dataclass(frozen=True)
class Address:
    """Where a robot is.

    Attributes:
        text: As the user writes it.
        candidate: The port that was chosen because nobody named a robot; else None.
    """

    text: str
    candidate: SerialPort | None = None

    def open(self, baud_rate: int | None = None, *, bare: bool = False) -> BaseDriver:
        """Open the robot.

        Args:
            baud_rate: Of a port; None: the usual one.
            bare: Leave a serial robot's parameters as they are, whatever its file says: for
                commands that look at it or stop it.

        Raises:
            InvalidArgument: A baud rate for what has none, or has it in its file.
            WheelwireError: As `open_driver` and `open_robot`.
        """
        from wheelwire.drivers.factory import open_driver
        from wheelwire.drivers.serial import DEFAULT_BAUD_RATE

        if self.text != MOCK and not self.text.endswith(_FILES):
            return open_driver("serial", port=self.text, baud_rate=baud_rate or DEFAULT_BAUD_RATE)
        if baud_rate is not None:
            raise InvalidArgument(
                f"--baud belongs to a port, not to {self.text}: leave it out; "
                "a robot's file has serial.baud_rate"
            )
        if self.text == MOCK:
            return open_driver("mock")
        return _open_file(self.text, bare=bare)

    def serial_port(self) -> str:
        """The serial port, where the firmware of a chip can be written.

        Raises:
            InvalidArgument: It is no serial port.
            ConfigurationError: The robot's file is invalid.
        """
        port = self.text
        if port.endswith(_FILES):
            robot = _load(port)
            port = robot.serial.port if robot.driver == "serial" else robot.driver
        if port == MOCK or port.startswith(("socket:", "unix:")) or port in ("l298n", "pigpio"):
            raise InvalidArgument(
                f"{self.text} is no serial port: give the one that the board is plugged in at"
            )
        return port

    def check_parameters(self, names: Collection[str], *, save: bool) -> None:
        """Look whether a change of parameters would hold.

        Raises:
            InvalidArgument: Nothing would keep it, or the robot's file would undo it.
            ConfigurationError: The robot's file is invalid.
        """
        if self.text == MOCK and save:
            raise InvalidArgument(
                "mock ends with this command, and nothing keeps its parameters: leave out --save, "
                "or run `wheelwire sim` and name its port"
            )
        if not self.text.endswith(_FILES):
            return
        robot = _load(self.text)
        if robot.driver != "serial":
            if save and robot.store is None:
                raise InvalidArgument(
                    f"{self.text} names no file in which this robot keeps parameters: "
                    "add `store:` to it"
                )
            return
        for name in names:
            if name in robot.parameters:
                raise InvalidArgument(
                    f"{self.text} sets {name} whenever the robot is opened: change it there"
                )


def outlives_commands(driver: BaseDriver) -> bool:
    """Whether the robot's core, its latch and its values are still there after `close`."""
    from wheelwire.drivers.serial import SerialDriver

    return isinstance(driver, SerialDriver)


def _load(file: str) -> RobotConfig:
    from wheelwire.config import load_config  # here, for what it imports is slow

    return load_config(file)


def _open_file(file: str, *, bare: bool) -> BaseDriver:
    from wheelwire.config import open_robot
    from wheelwire.drivers.factory import open_driver

    if bare and (robot := _load(file)).driver == "serial":
        return open_driver("serial", port=robot.serial.port, baud_rate=robot.serial.baud_rate)
    return open_robot(file)


def resolve(
    given: str | None, *, moves: bool = False, yes: bool = False, as_json: bool = False
) -> Address:
    """Which robot is meant: the one given, else $WHEELWIRE_ROBOT, else the only likely board.

    Args:
        given: The argument ROBOT.
        moves: The command moves wheels or lets them move: for a robot that nobody named it asks.
        yes: Do not ask.
        as_json: Errors are for a machine: say nothing else on stderr but a question.

    Raises:
        InvalidArgument: ROBOT is an empty text.
        RobotNotNamed: There is no such board, or several; or it was not confirmed.
    """
    if given == "":  # not the same as left out: it would mean another robot
        raise InvalidArgument(f"ROBOT is empty (a variable that is not set?): give {KINDS}")
    if given:
        return Address(given)
    if named := os.environ.get(ENVIRONMENT):
        if moves and not as_json:
            _say(f"{ENVIRONMENT} names {named}")
        return Address(named)
    port = _only_candidate()
    chosen = f"no robot is named; {port.device} is the only candidate ({port.note})"
    if moves and not yes:
        _confirm(port.device, chosen)
    elif not as_json:
        _say(chosen)
    return Address(port.device, port)


def _only_candidate() -> SerialPort:
    found = likely_boards()
    if not found:
        raise RobotNotNamed(
            "no robot is named, and no board is found: plug it in with a cable that carries data "
            "(many only charge) and look whether `wheelwire ports` lists it; or name the robot: "
            f"{KINDS}, as the first argument or in {ENVIRONMENT}"
        )
    if len(found) > 1:
        listed = ", ".join(f"{port.device} ({port.note})" for port in found)
        raise RobotNotNamed(
            f"no robot is named, and several ports may be it: {listed}; name one, "
            f"as the first argument or in {ENVIRONMENT}"
        )
    return found[0]


def _confirm(device: str, chosen: str) -> None:
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise RobotNotNamed(
            f"{chosen}, and there is no terminal to ask on: name the robot, "
            f"as the first argument or in {ENVIRONMENT}, or give --yes"
        )
    if not typer.confirm(f"{chosen}. Its wheels may move. Go on?", err=True):
        raise RobotNotNamed(f"nothing was done at {device}: name the robot that is meant")


def _say(text: str) -> None:
    typer.echo(f"wheelwire: {text}", err=True)


def looks_like_address(text: str) -> bool:
    """Whether it can only be ROBOT, where the name of a parameter may stand as well."""
    return text not in PARAMETER_BY_NAME and (
        text == MOCK or any(sign in text for sign in "/:.") or Path(text).exists()
    )
