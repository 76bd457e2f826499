"""Boards as YAML: those that are shipped, and a user's own."""

from __future__ import annotations

from pathlib import Path

import yaml

from wheelwire_protocol import native

from .board import BoardDescription, board_mapping, parse_board
from .errors import ConfigurationError
from .yaml_file import reading

_CHECKOUT = Path(__file__).parents[2]


def shipped_directory() -> Path:
    """Where the built-in boards are."""
    return _CHECKOUT / "boards" if native.is_checkout() else Path(__file__).parent / "boards"


def pictures_directory() -> Path:
    """Where the built-in boards' pictures are, NAME.svg each; relative in a checkout."""
    return Path("docs/boards") if native.is_checkout() else shipped_directory()


def shipped_boards() -> list[str]:
    """The names of the built-in boards."""
    return sorted(path.stem for path in shipped_directory().glob("*.yaml"))


def load_board(name: str | Path) -> BoardDescription:
    """Read a board from a file, or a built-in one by its name. What it says is not yet checked.

    Raises:
        ConfigurationError: There is no such board, or the file is not one. The message has the
            file, the key, the value and what is allowed.
    """
    known = shipped_boards()
    path = Path(name)
    # First: the name of a built-in board means the same in every folder.
    if str(name) in known:
        path = shipped_directory() / f"{name}.yaml"
    elif not path.exists():
        raise ConfigurationError(
            f"{name}: there is no such file, and the built-in boards are {', '.join(known)}"
        )
    with reading(path, "board") as content:
        return parse_board(content)


def checked_board(name: str | Path) -> BoardDescription:
    """As `load_board`, of a board that can be used.

    Raises:
        ConfigurationError: Also if the board breaks a rule; each is told in a line of its own.
    """
    board = load_board(name)
    if problems := board.problems():
        lines = "".join(f"\n  {problem}" for problem in problems)
        raise ConfigurationError(f"{name}: this board cannot be used:{lines}")
    return board


def to_yaml(board: BoardDescription) -> str:
    """The text of a file with this board."""
    # A wheel's pins in a line, as people write them.
    return yaml.safe_dump(board_mapping(board), sort_keys=False, default_flow_style=None)
