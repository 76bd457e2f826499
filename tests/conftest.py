"""Which tests must not run at the same time, where there are several processes."""

from __future__ import annotations

from pathlib import Path

import pytest

HERE = Path(__file__).parent
ALONE = {
    "ros": ("ros", "unit/ros_package/test_healthcheck.py"),  # each takes the next domain
    "rv32": ("firmware/test_rv32.py",),  # one build folder
    "fuzz": ("fuzz/test_targets.py",),  # one folder of seeds
}
"""Group -> its folders and files: all of them are run by one process."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tell pytest-xdist."""
    places = {HERE / place: group for group, named in ALONE.items() for place in named}
    for item in items:
        for place in (item.path, *item.path.parents):
            if place in places:
                item.add_marker(pytest.mark.xdist_group(places[place]))
