"""`wheelwire teleop`: drive by keyboard."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from wheelwire.errors import InvalidArgument, LinkLost, RequestTimeout
from wheelwire.robot.robot import Robot
from wheelwire.tools.teleop.drive import DEFAULT_SPEED, HELP, SPEEDS, drive
from wheelwire.tools.teleop.terminal import Terminal

from .address import Given, YesFlag, outlives_commands
from .interruptions import ended_by_signals, stop
from .output import print_lines
from .registry import Heading, command
from .sensors import ask_for_samples


@command("teleop", Heading.DRIVE, 2, page="teleop", has_json=False)
def teleop(
    given: Given,
    speed: Annotated[int, typer.Option(min=1, max=SPEEDS)] = DEFAULT_SPEED,
    yes: YesFlag = False,
) -> None:
    """Drive by keyboard: w a s d or the arrow keys, space stops, e latches an e-stop, q quits.

    Hold a key to keep driving. Most terminals do not report a release: a press drives for 0.7 s,
    each repeat of a held key for 0.2 s more.

    Args:
        given: The robot.
        speed: Speed at the start, in tenths of max_velocity_mps.
        yes: Do not ask.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise InvalidArgument(
            "teleop needs a terminal for its keys: run it in one, without a pipe; `wheelwire "
            "drive` does not"
        )
    address = given.resolve(moves=True, yes=yes)
    with (
        ended_by_signals() as ending,
        address.open(drives=True) as driver,
        ending.stops(driver, lambda: _what_remains(driver, address.text)),
    ):
        device = driver.info.device if driver.has_device else None
        ask_for_samples(driver)
        identity = f" ({device.board.name} {device.board_id})" if device else ""
        print_lines(f"driving {address.text}{identity}\n{HELP}")
        with Terminal(sys.stdin.fileno(), sys.stdout.fileno()) as terminal:
            drive(driver, terminal, speed)
        text = "; ".join(filter(None, (stop(driver), _what_remains(driver, address.text))))
        print_lines(text)


def _what_remains(driver: Robot, address: str) -> str:
    try:
        driver.read()  # it may be older than the last key
        state = driver.read().state
    except (LinkLost, RequestTimeout):
        return ""
    if state.is_latched and outlives_commands(driver):
        return f"{state.name} remains latched; `wheelwire clear {address}` ends it"
    return ""
