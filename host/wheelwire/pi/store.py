"""Files that are replaced as a whole."""

from __future__ import annotations

import os
from pathlib import Path


def write_whole(path: Path, content: bytes) -> None:
    """Replace the content of `path`: after a crash the old content or the new one is there."""
    # In the same folder: only within one file system is a rename atomic.
    new = path.with_name(path.name + ".new")
    with new.open("wb") as file:
        file.write(content)
        file.flush()
        # Without it a power cut may leave the new name with nothing behind it.
        os.fsync(file.fileno())
    new.replace(path)
