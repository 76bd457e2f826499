"""The black boxes and the ledger of a robot on this computer's pins: a file beside its store."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from wheelwire_protocol.native import RECORDER_SIZE, Core

from .guard import Heartbeat
from .latches import runtime_directory
from .settings import McuSettings


def recorder_path(settings: McuSettings) -> Path:
    """The file, beside the saved parameters; without those in memory, until the power is off."""
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
        # Each write is on the disk before the next: so a cut of the power leaves what one of a
        # chip's flash does, of which the core makes out an old box or a new one.
        flags = os.O_RDWR | os.O_CREAT | os.O_DSYNC | os.O_CLOEXEC | os.O_NOFOLLOW
        self._file = os.open(path, flags, 0o600)
        self.content = os.pread(self._file, RECORDER_SIZE + 1, 0)
        """The content when it was opened."""
        if len(self.content) != RECORDER_SIZE:
            # Another file's, or one that a crash cut off: as flash that was never written.
            self.content = b"\xff" * RECORDER_SIZE
            os.ftruncate(self._file, 0)
            os.pwrite(self._file, self.content, 0)

    def write(self, offset: int, data: bytes) -> bool:
        """Write a part; returns False if the disk refuses."""
        try:
            with self._heartbeat.saving():
                return os.pwrite(self._file, data, offset) == len(data)
        except OSError as error:
            sys.stderr.write(f"wheelwire: {self._path}: {error.strerror}\n")
            return False
