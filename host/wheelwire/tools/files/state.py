"""The folder for files that one command writes and a later one reads."""

from __future__ import annotations

import os
from pathlib import Path

from ...errors import OutputFailed


def state_folder() -> Path:
    """`$XDG_STATE_HOME/wheelwire`, by default in the home folder; it may not exist yet.

    Raises:
        OutputFailed: This user has no home folder.
    """
    if named := os.environ.get("XDG_STATE_HOME"):
        return Path(named) / "wheelwire"
    try:
        return Path.home() / ".local" / "state" / "wheelwire"
    except RuntimeError as error:  # for example, a container's user
        raise OutputFailed(
            "this user has no home folder to put files in: name a folder in XDG_STATE_HOME"
        ) from error
