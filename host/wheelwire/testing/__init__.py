"""The conformance tests that every driver passes, for authors of drivers. Needs pytest.

    from wheelwire.testing import Bench, DriverConformance

    class MyBench(Bench): ...

    class TestMyDriver(DriverConformance):
        @pytest.fixture
        def bench(self): yield MyBench()

An entry point in the group `wheelwire.drivers` makes the driver available to `open_driver` by name.
"""

import pytest

for _module in ("harness", "motion", "sampling", "stopping", "refusing", "lifecycle"):
    pytest.register_assert_rewrite(f"{__name__}.{_module}")

from .bench import Bench as Bench
from .conformance import DriverConformance as DriverConformance
from .harness import DriveHarness as DriveHarness

__all__ = ["Bench", "DriveHarness", "DriverConformance"]
