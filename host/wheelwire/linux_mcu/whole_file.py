"""A file that holds its old content or its new one, whatever happens while it is written."""

from __future__ import annotations

import os
from pathlib import Path


def write_whole(path: Path, content: bytes) -> None:
    """Replace the content of `path`. Raises OSError; the old content is there then."""
    # In the same folder: only within one file system is a rename atomic.
    new = path.with_name(path.name + ".new")
    with new.open("wb") as file:
        file.write(content)
        file.flush()
        # Without it a power cut may leave the new name with nothing behind it.
        os.fsync(file.fileno())
    new.replace(path)
