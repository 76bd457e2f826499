"""The tests that every driver passes, whatever is behind it.

Tolerances are a user's, not a loop's: how well the velocity is kept is measured elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from ..drivers.base import BaseDriver
from .bench import Bench
from .harness import DriveHarness
from .lifecycle import LifecycleTests
from .motion import MotionTests
from .refusing import RefusingTests
from .sampling import SamplingTests
from .stopping import StoppingTests


class DriverConformance(MotionTests, SamplingTests, StoppingTests, RefusingTests, LifecycleTests):
    """Derive from it, and give it a fixture `bench`."""

    @pytest.fixture
    def driver(self, bench: Bench) -> Iterator[BaseDriver]:
        """The driver under test."""
        with bench.open() as driver:
            yield driver

    @pytest.fixture
    def harness(self, driver: BaseDriver) -> DriveHarness:
        """It, and what it measures."""
        return DriveHarness(driver)
