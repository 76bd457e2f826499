"""The library's log records, as a node's logger gets them."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any
from unittest.mock import Mock, call

import pytest

from wheelwire_ros.library_log import LIBRARY, forward_library_log


def logger(name: str) -> Mock:
    """A stand-in for rclpy's logger; its only child notes what it is given."""
    made = Mock()
    made.name = name
    return made


def told(logger: Mock) -> list[Any]:
    """What its child was given."""
    logger.get_child.assert_called_once_with(LIBRARY)
    return list(logger.get_child.return_value.mock_calls)


@pytest.fixture
def library() -> Iterator[logging.Logger]:
    """The library's logger, put back afterwards."""
    library = logging.getLogger(LIBRARY)
    handlers, level = list(library.handlers), library.level
    yield library
    library.handlers[:] = handlers
    library.setLevel(level)


def test_each_severity_is_kept(library: logging.Logger) -> None:
    robot = logger("robot")
    forward_library_log(robot)
    levels = logging.DEBUG, logging.INFO, logging.WARNING, logging.ERROR, logging.CRITICAL
    for level in levels:
        library.log(level, "%s: link open", "/dev/wheelwire")
    text = "/dev/wheelwire: link open"
    expected = [getattr(call, one)(text) for one in ("debug", "info", "warning", "error", "fatal")]
    assert told(robot) == expected


def test_each_node_gets_each_record_once_also_one_that_is_made_again(
    library: logging.Logger,
) -> None:
    robots = left, right = logger("left"), logger("right")
    for robot in (*robots, left):
        forward_library_log(robot)
    library.error("unplugged")
    assert told(left) == told(right) == [call.error("unplugged")]
