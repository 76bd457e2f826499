"""Where commands of this user put what they need later."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import OutputFailed


def state_folder() -> Path:
    """`$XDG_STATE_HOME/wheelwire`, by default below the home folder; it may not exist yet.

    Raises:
        OutputFailed: This user has no home folder.
    """
    if named := os.environ.get("XDG_STATE_HOME"):
        return Path(named) / "wheelwire"
    try:
        return Path.home() / ".local" / "state" / "wheelwire"
    except RuntimeError as error:  # a container's user, for one
        raise OutputFailed(
            "this user has no home folder to put files in: name a folder in XDG_STATE_HOME"
        ) from error
