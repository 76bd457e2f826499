"""Replaces a file as a whole: a full disk or a crash leaves the old content or the new one."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST_WRITE_S = 60


def write_whole(path: Path, content: bytes, *, sync: bool = True) -> None:
    """Replace the content of `path`. If that fails, nothing else stays behind.

    A program that is killed meanwhile leaves a file beside it, which a call removes a minute later.

    Args:
        path: May be a link, or no regular file, such as /dev/stdout.
        content: All of it.
        sync: Wait for the disk, so that a power cut cannot lose it either.

    Raises:
        OSError: It cannot be written.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    # In the same folder: only within one file system is a rename atomic. Another program may be
    # writing the same file.
    new = path.with_name(f"{path.name}.{os.getpid()}.new")
    _remove_old(path.parent, f"{path.name}.")
    try:
        with new.open("wb") as file:
            file.write(content)
            if sync:
                file.flush()
                # Without it a power cut may leave the new name with nothing behind it.
                os.fsync(file.fileno())
        new.replace(path)
    except BaseException:
        with suppress(OSError):  # on a file system that is read-only by now it stays
            new.unlink(missing_ok=True)
        raise


def _remove_old(folder: Path, begin: str) -> None:
    oldest = time.time() - LONGEST_WRITE_S
    with suppress(OSError), os.scandir(folder) as entries:  # another one may remove it, too
        for entry in entries:
            left = entry.name.startswith(begin) and entry.name.endswith(".new")
            if left and entry.stat().st_mtime < oldest:
                Path(entry).unlink()


def save_figure(figure: Figure, path: Path, *, dpi: int) -> None:
    """Replace `path`, which ends in the kind of the picture, by a drawing.

    Raises:
        OSError: It cannot be written.
    """
    drawn = BytesIO()
    figure.savefig(drawn, format=path.suffix[1:], dpi=dpi)
    write_whole(path, drawn.getvalue())
