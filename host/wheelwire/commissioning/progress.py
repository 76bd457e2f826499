"""What an interrupted set-up has found, kept on this computer until one is finished."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

from ..errors import OutputFailed

ENVIRONMENT = "XDG_STATE_HOME"


class Progress:
    """The values found so far, of one robot.

    The robot itself has its previous values again after an interruption.

    Args:
        board_id: Of the robot.
        folder: Of the files; by default where programs of this user keep their state.
    """

    def __init__(self, board_id: str, folder: Path | None = None) -> None:
        state = os.environ.get(ENVIRONMENT) or Path.home() / ".local" / "state"
        self._file = (folder or Path(state) / "wheelwire") / f"setup-{board_id}.json"

    def load(self) -> dict[str, dict[str, float]]:
        """Values of parameters by step; none if there is no unfinished set-up."""
        try:
            content = json.loads(self._file.read_text("utf-8"))
        except (OSError, ValueError):
            # A damaged file is not worth an error: the set-up only begins anew.
            return {}
        return content if _is_valid(content) else {}

    def save(self, found: Mapping[str, Mapping[str, float]]) -> None:
        """Keep what was found.

        Raises:
            OutputFailed: It cannot be written.
        """
        # Replaced as a whole: if this is interrupted, the previous file is still there.
        new = self._file.with_suffix(".new")
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            new.write_text(json.dumps(found), "utf-8")
            new.replace(self._file)
        except OSError as error:
            raise OutputFailed(f"cannot write {self._file}: {error.strerror}") from error

    def forget(self) -> None:
        """It is finished."""
        self._file.unlink(missing_ok=True)


def _is_valid(content: object) -> bool:
    return isinstance(content, dict) and all(
        isinstance(values, dict)
        and all(isinstance(value, (int, float)) for value in values.values())
        for values in content.values()
    )
