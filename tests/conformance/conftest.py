"""`make test` runs the whole suite on the robot in virtual time, and one test on each driver."""

from __future__ import annotations

from pathlib import Path

import pytest

IN_DEPTH = "TestVirtualMock"
ON_EACH = "test_a_stop_removes_the_drive_and_the_wheels_come_to_rest"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        by_name = IN_DEPTH in item.nodeid or ON_EACH in item.nodeid
        if by_name and Path(__file__).parent in item.path.parents:  # slow for each of all tests
            item.add_marker("fast")
