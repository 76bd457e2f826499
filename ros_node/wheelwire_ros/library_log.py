"""The library's log records in ROS's log: the terminal, the log file, and /rosout."""

from __future__ import annotations

import logging
from typing import Any

LIBRARY = "wheelwire"
"""The name of the library's logger."""
LINK = "wheelwire.link"
"""The logger of the link's loss and return, which the node reports itself."""


def forward_library_log(logger: Any) -> None:
    """Pass the library's log records on to a node's logger. Safe to call more than once.

    Args:
        logger: The node's; the records come from its child `wheelwire`, with their severity, and
            its level decides which of them appear.
    """
    library = logging.getLogger(LIBRARY)
    if not any(isinstance(h, _RosHandler) and h.name == logger.name for h in library.handlers):
        library.addHandler(_RosHandler(logger))
        library.setLevel(logging.DEBUG)  # ROS's level is the one that users set


class _RosHandler(logging.Handler):
    """Logs each record with rclpy."""

    def __init__(self, logger: Any) -> None:
        super().__init__()
        self.name = logger.name
        self._logger = logger.get_child(LIBRARY)

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record; may be called in any thread."""
        if record.name == LINK:
            return
        text = self.format(record)
        # A call each: rclpy refuses another severity from the same line of code.
        if record.levelno >= logging.CRITICAL:
            self._logger.fatal(text)
        elif record.levelno >= logging.ERROR:
            self._logger.error(text)
        elif record.levelno >= logging.WARNING:
            self._logger.warning(text)
        elif record.levelno >= logging.INFO:
            self._logger.info(text)
        else:
            self._logger.debug(text)
