"""The library's log records, as a node's logger gets them."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from wheelwire_ros.library_log import LIBRARY, forward_library_log


class Logger:
    """A stand-in for rclpy's logger: keeps what it is given."""

    def __init__(self, name: str, lines: list[tuple[str, str, str]]) -> None:
        self.name = name
        self._lines = lines

    def get_child(self, name: str) -> Logger:
        return Logger(f"{self.name}.{name}", self._lines)

    def debug(self, text: str) -> None:
        self._lines.append((self.name, "debug", text))

    def info(self, text: str) -> None:
        self._lines.append((self.name, "info", text))

    def warning(self, text: str) -> None:
        self._lines.append((self.name, "warning", text))

    def error(self, text: str) -> None:
        self._lines.append((self.name, "error", text))

    def fatal(self, text: str) -> None:
        self._lines.append((self.name, "fatal", text))


@pytest.fixture
def library() -> Iterator[logging.Logger]:
    """The library's logger, put back afterwards."""
    library = logging.getLogger(LIBRARY)
    handlers, level = list(library.handlers), library.level
    yield library
    library.handlers[:] = handlers
    library.setLevel(level)


@pytest.mark.parametrize(
    ("level", "severity"),
    [
        (logging.DEBUG, "debug"),
        (logging.INFO, "info"),
        (logging.WARNING, "warning"),
        (logging.ERROR, "error"),
        (logging.CRITICAL, "fatal"),
    ],
)
def test_each_severity_is_kept(library: logging.Logger, level: int, severity: str) -> None:
    lines: list[tuple[str, str, str]] = []
    forward_library_log(Logger("robot", lines))
    library.log(level, "%s: link open", "/dev/wheelwire")
    assert lines == [("robot.wheelwire", severity, "/dev/wheelwire: link open")]


def test_a_node_that_is_made_again_gets_each_record_once(library: logging.Logger) -> None:
    lines: list[tuple[str, str, str]] = []
    for _ in range(2):
        forward_library_log(Logger("robot", lines))
    library.warning("unplugged")
    assert len(lines) == 1


def test_two_nodes_get_it_each(library: logging.Logger) -> None:
    lines: list[tuple[str, str, str]] = []
    forward_library_log(Logger("left", lines))
    forward_library_log(Logger("right", lines))
    library.error("unplugged")
    assert [name for name, _, _ in lines] == ["left.wheelwire", "right.wheelwire"]


def test_an_exception_is_logged(library: logging.Logger) -> None:
    lines: list[tuple[str, str, str]] = []
    forward_library_log(Logger("robot", lines))
    library.error("reading failed", exc_info=OSError("unplugged"))
    ((_, severity, text),) = lines
    assert severity == "error"
    assert text == "reading failed\nOSError: unplugged"
