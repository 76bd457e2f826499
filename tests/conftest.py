"""Which tests must not run at the same time, where there are several processes.

Hypothesis measures no time: how long an example takes says how busy the computer is.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

os.environ.pop("WHEELWIRE_ROBOT", None)  # the robot of whoever runs the tests is none of theirs

settings.register_profile("wheelwire", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("wheelwire")

HERE = Path(__file__).parent
ALONE = {
    "ros": ("ros", "unit/ros_package/test_healthcheck.py"),  # each takes the next domain
    "tutorial": ("loop/test_docs.py",),  # page after page on one robot
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
