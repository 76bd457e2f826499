"""What is latched on this computer's robots: a small file that outlives their processes.

It lies on a file system in memory, so an e-stop and a fault end with the computer's power at the
latest, and writing it does not wait for a disk.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from ..errors import ConfigurationError
from .settings import McuSettings

DIRECTORY_VARIABLE = "WHEELWIRE_RUNTIME_DIR"
UNREADABLE = b"unreadable"
"""Bytes that are no record, which the core treats as an e-stop."""


class LatchFile:
    """The record of one robot.

    Args:
        path: Its file, in a directory of our own.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> bytes:
        """The record saved last; empty if there is none, `UNREADABLE` if it cannot be read."""
        try:
            # A whole record has at least a byte: an empty file is a damaged one.
            return self._path.read_bytes() or UNREADABLE
        except FileNotFoundError:
            return b""
        except OSError as error:
            sys.stderr.write(f"wheelwire: {self._path}: {error.strerror}: treated as an e-stop\n")
            return UNREADABLE

    def save(self, record: bytes) -> bool:
        """Replace the record. Called while driving: without waiting for a disk."""
        new = self._path.with_suffix(".new")
        try:
            new.write_bytes(record)
            new.replace(self._path)
        except OSError as error:
            sys.stderr.write(f"wheelwire: {self._path}: {error.strerror}\n")
            return False
        return True


def latch_file(settings: McuSettings) -> LatchFile:
    """The record of the robot with these settings.

    Raises:
        ConfigurationError: There is no directory in which it would be safe.
    """
    name = f"{settings.identity}.latch"
    return LatchFile(runtime_directory() / name.replace(os.sep, "_"))


def runtime_directory() -> Path:
    """Our directory for files that last as long as the computer runs, made if necessary.

    Raises:
        ConfigurationError: Somebody else owns it, or may write to it.
    """
    if named := os.environ.get(DIRECTORY_VARIABLE):
        return _own(Path(named))
    # A service that restarts as another user would not find its record elsewhere.
    with suppress(OSError, ConfigurationError):
        return _own(Path("/run/wheelwire"))
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        return _own(Path(session) / "wheelwire")
    return _own(Path(tempfile.gettempdir()) / f"wheelwire-{os.getuid()}")


def _own(path: Path) -> Path:
    path.mkdir(mode=0o700, exist_ok=True)
    found = path.lstat()
    # Whoever can write there could end an e-stop.
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    if not is_ours or found.st_mode & 0o022:
        raise ConfigurationError(
            f"{path} is not a directory that only this user can write to: remove it, or name "
            f"another one in {DIRECTORY_VARIABLE}"
        )
    return path
