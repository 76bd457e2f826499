"""Which programs have driven a robot, so that one that died can be named.

Each board has a small file in the folder of the taps, which only this user can get into.
"""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path

from ..holds import Program, start_of
from .runtime_folder import TapDirectory, tap_directories

KEPT = 8
"""Sessions of one board that are remembered."""
LONGEST_COMMAND = 200
_SUFFIX = ".programs"


def note_driver(directory: TapDirectory, board_id: str, session_id: int) -> None:
    """Remember that this program drives in a session.

    Raises:
        OSError: The file cannot be written.
    """
    path = directory.path / f"{board_id}{_SUFFIX}"
    with directory.locked():
        known = [one for one in _read(path) if one[0] != session_id]
        known.append((session_id, this_program()))
        new = path.with_name(f"{path.name}.new")
        new.write_text(json.dumps(known[-KEPT:]), "utf-8")
        new.replace(path)


def driver_of(board_id: str, session_id: int) -> Program | None:
    """The program that drove in a session; None if it is none of this user's on this computer."""
    for directory in tap_directories():
        for known_id, program in _read(directory.path / f"{board_id}{_SUFFIX}"):
            if known_id == session_id:
                return program
    return None


def this_program() -> Program:
    """The program that calls this."""
    try:
        words = Path("/proc/self/cmdline").read_bytes().decode("utf-8", "replace").split("\0")
    except OSError:
        words = ["?"]
    command = shlex.join(word for word in words if word)
    pid = os.getpid()
    return Program(pid, start_of(pid) or 0, command[:LONGEST_COMMAND])


def _read(path: Path) -> list[tuple[int, Program]]:
    try:
        return [(int(known), Program(*one)) for known, one in json.loads(path.read_text("utf-8"))]
    except (OSError, ValueError, TypeError):
        return []  # there is none, or somebody has written something else into it
