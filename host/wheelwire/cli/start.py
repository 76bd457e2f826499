"""`wheelwire start`: from a board that was just plugged in to the first drive, step by step."""

from __future__ import annotations

import sys
from pathlib import Path

from wheelwire import errors
from wheelwire.arguments import at_home
from wheelwire.connect import MOCK
from wheelwire.link.ports import likely_boards
from wheelwire.parameters import definition_of
from wheelwire_protocol.codes import ConfigurationState

from .address import Address, Given, RobotArgument
from .board import confirm
from .flash import flash
from .output import print_lines
from .prompts import ask, ask_until
from .registry import Heading, command
from .robot import drive
from .setup import set_up_at

_SPEED_MPS = 0.1
_SECONDS = 2.0
_LOOK = "look"
_BUILD, _SKIP = "build", "skip"
_SHOWN = 3
"""So many values show that a robot has been set up."""
_NO_FIRMWARE = (errors.DeviceSilent, errors.ForeignDevice, errors.ProtocolMismatch)


@command("start", Heading.BUILD, 1, page="first-hour", has_json=False)
def start(robot: RobotArgument = None, image: Path | None = None) -> None:
    """Lead from a board that was just plugged in to the first drive.

    Five steps: find the port, write the firmware, confirm the board, set up, drive 20 cm. You can
    skip each. After an error, run the command again.

    Args:
        robot: The board's port, if it is known.
        image: Firmware from a release, as for `wheelwire flash`.
    """
    if not sys.stdin.isatty():
        raise errors.InvalidArgument(
            "start asks questions: run it in a terminal; scripts use flash, board, setup and drive"
        )
    address = _find(robot)
    if not _write_firmware(address, image):
        print_lines(
            "The other steps need the firmware: write it, then run `wheelwire start "
            f"{address.text}` again"
        )
        return
    _confirm_board(address)
    _set_up(address)
    _drive(address)
    print_lines(
        f"Next: `wheelwire teleop {address.text}` drives it by keyboard, `wheelwire monitor "
        f"{address.text}` shows what it does, and `wheelwire help python` has programs"
    )


def _find(given: str | None) -> Address:
    print_lines("1/5 Port")
    if (known := Given(given).named()) is not None:
        if known.text == MOCK:
            raise errors.InvalidArgument(
                "mock exists only while one command runs: start `wheelwire sim`, then "
                "`wheelwire start /tmp/wheelwire`"
            )
        port = known.serial_port()
        print_lines(f"done already: {port} was named")
        return Address(port)
    while not (found := likely_boards()):
        answer = ask(
            "No board is plugged in. Plug it in with a cable that carries data: many only charge. "
            "`wheelwire help troubleshooting/port` has more. Type its port, or Enter to look again",
            _LOOK,
        )
        if answer != _LOOK:
            return Address(Address(answer).serial_port())
    if len(found) == 1:
        print_lines(f"found: {found[0].device} ({found[0].note})")
        return Address(found[0].device)
    print_lines(*(f"{port.device}: {port.note}" for port in found))
    return Address(_choose("Which one is the robot?", *(port.device for port in found)))


def _write_firmware(address: Address, image: Path | None) -> bool:
    """Whether there is firmware now."""
    print_lines("2/5 Firmware")
    try:
        with address.open_to_look() as driver:
            release = driver.info.device.release if driver.has_device else ""
    except _NO_FIRMWARE as error:
        print_lines(str(error))
    else:
        print_lines(f"done already: firmware {release} answers")
        return True
    if image is None:
        given = _ask_image()
        if given == _SKIP:
            return False
        image = None if given == _BUILD else Path(given)
    if not _wants(
        "Disconnect the motors' battery until the set-up: the chip may hold another program. "
        f"Write {image or 'the image of this checkout'} to {address.text}?"
    ):
        return False
    flash(address.text, image=image)
    return True


def _ask_image() -> str:
    """The file of an image, `_BUILD` or `_SKIP`."""
    from wheelwire.tools.flash import built_chips, read_image  # here: for a new board alone

    built = ", ".join(chip.name for chip in built_chips())
    words = [_BUILD, _SKIP] if built else [_SKIP]
    if built:
        question = f"Image of a release, `{_BUILD}` (this checkout's, for {built}) or `{_SKIP}`"
    else:
        print_lines(
            "The firmware is a file of a release: download wheelwire-esp32.bin, or for another "
            "chip wheelwire-esp32s3.bin or wheelwire-esp32c6.bin. From a checkout with PlatformIO, "
            "`pio run -e esp32 -t upload` builds and writes it: then run start again"
        )
        question = f"The file's path, or `{_SKIP}`"

    def parse(given: str) -> str:
        if given in words:
            return given
        file = at_home(Path(given))
        try:
            read_image(file)
        except errors.FlashFailed as error:
            raise errors.InvalidArgument(str(error)) from error
        return str(file)

    return ask_until(question, parse, _BUILD if built else None)


def _confirm_board(address: Address) -> None:
    print_lines("3/5 Board")
    with address.open_to_look() as driver:
        if not driver.has_device:
            return
        state, found = driver.board.read()
    if state is ConfigurationState.STORED and found is not None:
        print_lines(f"done already: {found.name}")
    elif _wants(
        "Look at the driver board that the firmware believes in? With another one choose skip, "
        "and name yours in the next step."
    ):
        confirm(Given(address.text))


def _set_up(address: Address) -> None:
    from wheelwire.tools.setup.setup import CHANGED  # here: numpy is slow to import

    print_lines("4/5 Set-up")
    with address.open_to_look() as driver:
        changed = [
            f"{name} {driver.parameters[name]:g}"
            for name in CHANGED
            if driver.parameters[name] != definition_of(name).default
        ]
    question = "Find the wiring, the numbers and the gains? It takes about five minutes."
    if changed:
        others = " and others" if len(changed) > _SHOWN else ""
        print_lines(f"done already: {', '.join(changed[:_SHOWN])}{others}")
        question = "Set it up again?"
    if _wants(question, default="skip" if changed else "yes"):
        set_up_at(address)


def _drive(address: Address) -> None:
    print_lines("5/5 First drive")
    if _wants(
        "Put the robot on the floor, with a metre free ahead of it, and a hand near the e-stop. "
        f"Drive {_SPEED_MPS * _SECONDS * 100:.0f} cm forward?"
    ):
        drive(Given(address.text), linear=_SPEED_MPS, seconds=_SECONDS)


def _wants(question: str, default: str = "yes") -> bool:
    """Whether to carry out a step."""
    return _choose(question, "yes", "skip", default=default) == "yes"


def _choose(question: str, *choices: str, default: str | None = None) -> str:
    """One of the choices, or the only one that begins with what was typed."""

    def parse(given: str) -> str:
        found = [choice for choice in choices if choice.startswith(given)]
        if given in choices or len(found) == 1:
            return given if given in choices else found[0]
        raise errors.InvalidArgument(f"answer with {' or '.join(choices)}")

    return ask_until(f"{question} ({', '.join(choices)})", parse, default)
