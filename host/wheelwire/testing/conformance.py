"""The tests that every driver passes, whatever hardware is behind it.

Their tolerances are wide: how well the controller holds a velocity is measured elsewhere.
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
    """Derive a test class from this one and give it a fixture `bench`."""

    @pytest.fixture
    def driver(self, bench: Bench) -> Iterator[BaseDriver]:
        """The driver under test."""
        with bench.open() as driver:
            yield driver

    @pytest.fixture
    def harness(self, driver: BaseDriver) -> DriveHarness:
        """The driver under test in a harness."""
        return DriveHarness(driver)
