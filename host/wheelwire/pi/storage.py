"""What a robot on this computer's pins keeps in files: parameters, black boxes and latches.

Parameters and black boxes survive the power. The latches lie on a file system in memory: an e-stop
and a fault end with the computer's power at the latest, and writing one waits for no disk.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from wheelwire_protocol.core import RECORDER_SIZE, Core

from ..errors import ConfigurationError
from ..whole_file import write_whole
from .guard import Heartbeat
from .settings import McuSettings


class ParameterFile:
    """A file with the block of saved parameters. The core checks its content."""

    def __init__(self, path: str | None, heartbeat: Heartbeat) -> None:
        self._path = Path(path) if path else None
        self._heartbeat = heartbeat

    def load(self) -> bytes:
        """The block saved last; empty if there is none.

        Raises:
            ConfigurationError: It cannot be read.
        """
        if self._path is None:
            return b""
        try:
            return self._path.read_bytes()
        except FileNotFoundError:
            return b""
        except OSError as error:
            # Not an empty store: the robot would drive with defaults that nobody chose for it.
            raise ConfigurationError(
                f"{self._path}: {error.strerror}: correct the path of the store or its permissions"
            ) from error

    def save(self, block: bytes) -> bool:
        """Replace the file atomically: after a crash it holds the old block or the new one."""
        if self._path is None:
            return not block  # nothing to forget is a success; nowhere to save is a failure
        try:
            with self._heartbeat.saving():
                if block:
                    write_whole(self._path, block)
                else:
                    self._path.unlink(missing_ok=True)
        except OSError as error:
            sys.stderr.write(f"wheelwire: {self._path}: {error.strerror}\n")
            return False
        return True


def recorder_path(settings: McuSettings) -> Path:
    """The file next to the saved parameters; without those, memory, until the power is off."""
    if settings.store is not None:
        store = Path(settings.store)
        return store.with_name(f"{store.name}.recorder")
    return runtime_directory() / f"{settings.identity}.recorder".replace(os.sep, "_")


def keep_recorder(core: Core, settings: McuSettings, heartbeat: Heartbeat) -> None:
    """Make the core record. If no file can be written, log that, and record nothing."""
    path = recorder_path(settings)
    try:
        file = RecorderFile(path, heartbeat)
    except OSError as error:
        sys.stderr.write(f"wheelwire: {path}: {error.strerror}: no black box is stored\n")
        return
    core.keep_recorder(file.content, file.write)


class RecorderFile:
    """The content of a recorder, written in the order in which the core writes it.

    Args:
        path: Made if it is not there, or not of the recorder's size.
        heartbeat: Says that a write may wait for the disk.
    """

    def __init__(self, path: Path, heartbeat: Heartbeat) -> None:
        self._path = path
        self._heartbeat = heartbeat
        # Each write is on the disk before the next. So after a power cut it looks like a chip's
        # flash after one, where the core finds either an old box or a new one.
        flags = os.O_RDWR | os.O_CREAT | os.O_DSYNC | os.O_CLOEXEC | os.O_NOFOLLOW
        self._file = os.open(path, flags, 0o600)
        self.content = os.pread(self._file, RECORDER_SIZE + 1, 0)
        """The content when it was opened."""
        if len(self.content) != RECORDER_SIZE:
            # Another file's, or one that a crash cut off: as flash that was never written.
            self.content = b"\xff" * RECORDER_SIZE
            os.ftruncate(self._file, 0)
            if os.pwrite(self._file, self.content, 0) < RECORDER_SIZE:
                os.close(self._file)
                path.unlink()
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def write(self, offset: int, data: bytes) -> bool:
        """Write a part; returns False if the disk refuses."""
        try:
            with self._heartbeat.saving():
                return os.pwrite(self._file, data, offset) == len(data)
        except OSError as error:
            sys.stderr.write(f"wheelwire: {self._path}: {error.strerror}\n")
            return False


DIRECTORY_VARIABLE = "WHEELWIRE_RUNTIME_DIR"
UNREADABLE = b"unreadable"
"""Bytes that are not a record; the core treats them as an e-stop."""


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
        try:
            write_whole(self._path, record, sync=False)
        except OSError as error:
            sys.stderr.write(f"wheelwire: {self._path}: {error.strerror}\n")
            return False
        return True


def latch_file(settings: McuSettings) -> LatchFile:
    """The record of the robot with these settings.

    Raises:
        ConfigurationError: No directory is safe for it.
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
    # Anyone who can write there could end an e-stop.
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    if not is_ours or found.st_mode & 0o022:
        raise ConfigurationError(
            f"{path} is not a directory that only this user can write to: remove it, or name "
            f"another one in {DIRECTORY_VARIABLE}"
        )
    return path
