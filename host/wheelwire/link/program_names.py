"""How a program of this computer is named in messages."""

from __future__ import annotations

import shlex
from contextlib import suppress
from pathlib import Path

LONGEST = 80
_PROC = Path("/proc")


def program_name(pid: int, proc: Path = _PROC) -> str:
    """The command line of a process, shortened: `python3 follow_line.py`, `wheelwire monitor`.

    Leaves out the folders of files and programs, because the name may get into a recording. If the
    system does not give the command line: the program's name, or "a program".
    """
    with suppress(OSError):
        data = (proc / str(pid) / "cmdline").read_bytes()
        words = data.decode("utf-8", "replace").rstrip("\0").split("\0")
        if words[0]:
            return _shortened(_without_interpreter(words))
    with suppress(OSError):
        return (proc / str(pid) / "comm").read_text("utf-8", "replace").strip()
    return "a program"


def process_name(pid: int) -> str:
    """As `program_name`, with its number: `python3 follow_line.py, process 4711`."""
    return f"{program_name(pid)}, process {pid}"


def _without_interpreter(words: list[str]) -> list[str]:
    """Leave out the Python that runs an installed command, whose script has no suffix."""
    is_python = Path(words[0]).name.startswith("python")
    if is_python and words[1:2] == ["-m"] and len(words) > 2:
        return words[2:]
    if is_python and len(words) > 1 and not words[1].startswith("-") and "." not in words[1][1:]:
        return words[1:]
    return words


def _shortened(words: list[str]) -> str:
    # A port is named in full: it is not a person's.
    names = [one if one.startswith("/dev/") else one.rpartition("/")[2] or one for one in words]
    text = "".join(sign if sign.isprintable() else "?" for sign in shlex.join(names))
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
