"""Boards as YAML: those that are shipped, and a user's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from wheelwire_protocol import native
from wheelwire_protocol.board import (
    CHIPS,
    MODULES,
    NAME_SIZE,
    OUTPUTS,
    STAGES,
    BoardLine,
    ContactKind,
    EncoderPulls,
    Module,
    Stage,
)

from ..board import BoardDescription, WheelPins
from ..errors import ConfigurationError
from .peripherals import SECTIONS, parse_peripherals, peripheral_sections
from .reading import Section, file_named, names_in, reading

CHIP_BY_NAME = {table.name: chip for chip, table in CHIPS.items()}
STAGE_BY_NAME = {stage.name.lower(): stage for stage in Stage}
ANY_MODULE = "any"
MODULE_BY_NAME = {
    ANY_MODULE: Module.ANY,
    **{table.name: module for module, table in MODULES.items()},
}
_LINES = {"uart": BoardLine.UART, "usb": BoardLine.USB}
_PULLS = {"internal": EncoderPulls.INTERNAL, "external": EncoderPulls.EXTERNAL}
_CONTACTS = {
    "normally_closed": ContactKind.NORMALLY_CLOSED,
    "normally_open": ContactKind.NORMALLY_OPEN,
}
_TOP = [
    *("name", "chip", "module", "stage", "left", "right", "standby"),
    *("pwm_frequency_hz", "encoder_pulls", "encoder_filter_ns"),
    *("estop", "battery", "led", "link", "pulldowns"),
    *SECTIONS,
]
_WHEEL = [field.name for field in fields(WheelPins)]
_LAST_PULLED_DOWN = 63
"""The pulled-down pins travel as the bits of one 64-bit number."""
_CHECKOUT = Path(__file__).parents[3]

_Code = TypeVar("_Code")


def shipped_directory() -> Path:
    """The folder of the built-in boards."""
    return _CHECKOUT / "boards" if native.is_checkout() else Path(__file__).parents[1] / "boards"


def pictures_directory() -> Path:
    """The folder of the built-in boards' pictures, NAME.svg; a relative path in a checkout."""
    return Path("docs/boards") if native.is_checkout() else shipped_directory()


def shipped_boards() -> list[str]:
    """The names of the built-in boards."""
    return names_in(shipped_directory())


def load_board(name: str | Path) -> BoardDescription:
    """Read a board from a file, or a built-in one by its name, without checking its rules.

    Raises:
        ConfigurationError: There is no such board, or the file is no board. The message has the
            file, the key, the value and what is allowed.
    """
    with reading(file_named(name, shipped_directory(), "board"), "board") as content:
        return parse_board(content)


def checked_board(name: str | Path) -> BoardDescription:
    """Load a board as `load_board` does, and check its rules.

    Raises:
        ConfigurationError: Also if the board breaks a rule; each rule has a line of its own.
    """
    board = load_board(name)
    if problems := board.problems():
        lines = "".join(f"\n  {problem}" for problem in problems)
        raise ConfigurationError(f"{name}: this board cannot be used:{lines}")
    return board


def parse_board(content: object) -> BoardDescription:
    """Build a board from the content of a file. Checks names and types; `problems` checks the rest.

    Raises:
        ConfigurationError: A key is unknown or missing, or a value is not of its kind.
    """
    board = Section(content, _TOP)
    # A missing section counts as an empty one: none of its keys is required.
    estop = Section(board.get("estop", {}), ["pin", "contact"], "estop")
    battery = Section(board.get("battery", {}), ["pin", "divider"], "battery")
    name = board.get("name")
    if not isinstance(name, str) or not name.isascii() or not 0 < len(name) <= NAME_SIZE:
        raise board.refusal("name", f"it must be 1 to {NAME_SIZE} ASCII characters")
    pulldowns = board.get("pulldowns", None) or []
    if not isinstance(pulldowns, list) or not all(
        type(pin) is int and 0 <= pin <= _LAST_PULLED_DOWN for pin in pulldowns
    ):
        raise board.refusal("pulldowns", f"give a list of GPIO numbers, 0 to {_LAST_PULLED_DOWN}")
    return BoardDescription(
        name=name,
        chip=board.code("chip", CHIP_BY_NAME),
        module=board.code("module", MODULE_BY_NAME, ANY_MODULE),
        stage=board.code("stage", STAGE_BY_NAME),
        left=_wheel(board, "left"),
        right=_wheel(board, "right"),
        standby=board.pin("standby"),
        pwm_frequency_hz=board.whole("pwm_frequency_hz", 65_535, 20_000),
        encoder_pulls=board.code("encoder_pulls", _PULLS, "internal"),
        encoder_filter_ns=board.whole("encoder_filter_ns", 65_535, 1000),
        estop=estop.pin("pin"),
        estop_contact=estop.code("contact", _CONTACTS, "normally_closed"),
        battery=battery.pin("pin"),
        battery_divider=battery.above_zero("divider", 4.0),
        led=board.pin("led"),
        line=board.code("link", _LINES, "uart"),
        pulldowns=frozenset(pulldowns),
        peripherals=parse_peripherals(board),
    )


def board_mapping(board: BoardDescription) -> dict[str, Any]:
    """The content of a file with this board; `parse_board` makes the same board from it."""
    stage = STAGES[board.stage]
    content: dict[str, Any] = {
        "name": board.name,
        "chip": CHIPS[board.chip].name,
        "stage": board.stage.name.lower(),
    }
    if board.module is not Module.ANY:
        content["module"] = MODULES[board.module].name
    for side in ("left", "right"):
        wheel: WheelPins = getattr(board, side)
        # Also pins for which the stage has no input: a board that breaks a rule is shown as it is.
        names = [*(n for n in OUTPUTS if n in stage.inputs or getattr(wheel, n) is not None)]
        content[side] = {
            name: pin
            for name in (*names, "encoder_a", "encoder_b")
            if (pin := getattr(wheel, name)) is not None
        }
    if board.standby is not None:
        content["standby"] = board.standby
    content["pwm_frequency_hz"] = board.pwm_frequency_hz
    content["encoder_pulls"] = _name_of(board.encoder_pulls, _PULLS)
    content["encoder_filter_ns"] = board.encoder_filter_ns
    # Without a pin the kind of contact means nothing, nor does the divider below.
    if board.estop is not None:
        contact = _name_of(board.estop_contact, _CONTACTS)
        content["estop"] = {"pin": board.estop, "contact": contact}
    if board.battery is not None:
        content["battery"] = {"pin": board.battery, "divider": board.battery_divider}
    if board.led is not None:
        content["led"] = board.led
    content["link"] = _name_of(board.line, _LINES)
    content["pulldowns"] = sorted(board.pulldowns)
    return content | peripheral_sections(board.peripherals)


def to_yaml(board: BoardDescription) -> str:
    """The text of a file with this board."""
    from .yaml_text import dump  # here, for it is slow to import

    return dump(board_mapping(board))


def _wheel(board: Section, side: str) -> WheelPins:
    wheel = Section(board.get(side), _WHEEL, side)
    return WheelPins(**{name: wheel.pin(name) for name in _WHEEL})


def _name_of(code: _Code, codes: Mapping[str, _Code]) -> str:
    return next(name for name, value in codes.items() if value == code)
