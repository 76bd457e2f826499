"""Boards as YAML: the built-in ones, and a user's own."""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from wheelwire_protocol import native
from wheelwire_protocol.board import (
    CHIPS,
    MODULES,
    NAME_SIZE,
    BoardLine,
    ContactKind,
    EncoderPulls,
    Module,
)
from wheelwire_protocol.codes import ConfigurationState
from wheelwire_protocol.power_stages import Stage

from ...board import Configuration, WheelPins
from ...errors import ConfigurationError
from .peripherals import SECTIONS, parse_peripherals, peripheral_sections, without_none
from .reading import Section, file_named, names_in, reading

CHIP_BY_NAME = {table.name: chip for chip, table in CHIPS.items()}
STAGE_BY_NAME = {stage.name.lower(): stage for stage in Stage}
ANY_MODULE = "any"
MODULE_BY_NAME = {
    ANY_MODULE: Module.ANY,
    **{table.name: module for module, table in MODULES.items()},
}
_LINES = {line.name.lower(): line for line in BoardLine}
_PULLS = {pulls.name.lower(): pulls for pulls in EncoderPulls}
_CONTACTS = {contact.name.lower(): contact for contact in ContactKind}
_TOP = [
    *("name", "chip", "module", "stage", "left", "right", "standby"),
    *("pwm_frequency_hz", "encoder_pulls", "encoder_filter_ns"),
    *("estop", "battery", "led", "link", "pulldowns"),
    *SECTIONS,
]
_WHEEL = [field.name for field in fields(WheelPins)]
_LAST_PULLED_DOWN = 63
"""The pulled-down pins travel as the bits of one 64-bit number."""
_CHECKOUT = Path(__file__).parents[4]


def shipped_directory() -> Path:
    """The folder of the built-in boards."""
    return _CHECKOUT / "boards" if native.is_checkout() else Path(__file__).parents[2] / "boards"


def pictures_directory() -> Path:
    """The folder of the built-in boards' pictures, NAME.svg; a relative path in a checkout."""
    return Path("docs/boards") if native.is_checkout() else shipped_directory()


def shipped_boards() -> list[str]:
    """The names of the built-in boards."""
    return names_in(shipped_directory())


def load_board(name: str | Path) -> Configuration:
    """Read a board from a file, or a built-in one by its name, without checking its rules.

    Raises:
        ConfigurationError: The board does not exist, or the file is not a board. The message has
            the file, the key, the value and what is allowed.
    """
    with reading(file_named(name, shipped_directory(), "board"), "board") as content:
        return parse_board(content)


def checked_board(name: str | Path) -> Configuration:
    """Load a board as `load_board` does, and check its rules.

    Raises:
        ConfigurationError: Also if the board breaks a rule; each rule has a line of its own.
    """
    board = load_board(name)
    if problems := board.problems():
        lines = "".join(f"\n  {problem}" for problem in problems)
        raise ConfigurationError(f"{name}: this board cannot be used:{lines}")
    return board


def parse_board(content: object) -> Configuration:
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
    return Configuration(
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


def board_mapping(board: Configuration) -> dict[str, Any]:
    """The content of a file with this board; `parse_board` makes the same board from it."""
    content = {
        "name": board.name,
        "chip": CHIPS[board.chip].name,
        "stage": board.stage.name.lower(),
        "module": None if board.module is Module.ANY else MODULES[board.module].name,
        # Also pins that the stage has no input for: a board that breaks a rule is shown unchanged.
        "left": without_none(asdict(board.left)),
        "right": without_none(asdict(board.right)),
        "standby": board.standby,
        "pwm_frequency_hz": board.pwm_frequency_hz,
        "encoder_pulls": board.encoder_pulls.name.lower(),
        "encoder_filter_ns": board.encoder_filter_ns,
        # Without a pin, neither the kind of contact nor the divider below means anything.
        "estop": None
        if board.estop is None
        else {"pin": board.estop, "contact": board.estop_contact.name.lower()},
        "battery": None
        if board.battery is None
        else {"pin": board.battery, "divider": board.battery_divider},
        "led": board.led,
        "link": board.line.name.lower(),
        "pulldowns": sorted(board.pulldowns),
    }
    return without_none(content) | peripheral_sections(board.peripherals)


def to_yaml(board: Configuration) -> str:
    """The text of a file with this board."""
    from .yaml_text import dump  # here: it is slow to import

    return dump(board_mapping(board))


def reported(state: ConfigurationState, board: Configuration | None) -> str:
    """A file with the board that a device reports; the board's state is a comment."""
    return f"# {state.doc}\n{to_yaml(board) if board else ''}"


def _wheel(board: Section, side: str) -> WheelPins:
    wheel = Section(board.get(side), _WHEEL, side)
    return WheelPins(**{name: wheel.pin(name) for name in _WHEEL})
