"""`wheelwire monitor` on the whole screen of a terminal, where there is one."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path

from wheelwire.connect import is_recording, is_robot_file
from wheelwire.tools.files.robot import load_config

from .address import Address
from .interruptions import Interrupted
from .output import print_note
from .sensors import ask_for_samples


def can_show() -> bool:
    """Whether to use the whole screen; prints what to install, if only that is missing.

    A picture needs a terminal that moves its cursor, and has more than ASCII.
    """
    # Textual draws to standard error.
    is_terminal = all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))
    is_unicode = (sys.stdout.encoding or "").lower().startswith("utf")
    if not is_terminal or not is_unicode or os.environ.get("TERM", "dumb") == "dumb":
        return False
    if find_spec("textual") is None:
        print_note("for a view on the whole screen: pip install 'wheelwire[view]'")
        return False
    return True


def show(address: Address, seconds: float) -> None:
    """Show the robot until a key or a signal ends it.

    Raises:
        Interrupted: It was a signal, or Ctrl-C.
        WheelwireError: As `Address.open_to_look`; `LinkClosed` if the robot is gone for good.
    """
    from wheelwire.tools.view.app import show  # here, for Textual is slow to import

    with address.open_to_look() as driver:
        ask_for_samples(driver)  # for its recording, and for attached programs
        ended_by = show(
            driver,
            address.text,
            recording=Path(address.text) if is_recording(address.text) else None,
            seconds=seconds,
            cannot_drive=_cannot_drive(address.text),
            check_save=lambda name: address.check_parameters([name], save=True),
        )
    if ended_by is not None:
        raise Interrupted(128 + ended_by, "interrupted")


def _cannot_drive(address: str) -> str:
    """Why this does not drive a robot whose file sets values: a look opens it without them."""
    if not is_robot_file(address):
        return ""
    robot = load_config(address)
    if robot.driver != "serial" or not (robot.parameters or robot.board):
        return ""
    return (
        f"{address} sets parameters or a board, which are not set for a look: "
        f"`wheelwire teleop {address}` drives with them"
    )
