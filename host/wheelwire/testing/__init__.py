"""For authors of drivers: the tests that every driver passes. Needs pytest.

    from wheelwire.testing import Bench, DriverConformance

    class MyBench(Bench): ...

    class TestMyDriver(DriverConformance):
        @pytest.fixture
        def bench(self): yield MyBench()

The entry point group `wheelwire.drivers` then offers the driver to `open_driver` by name.
"""

import pytest

for _module in ("harness", "motion", "sampling", "stopping", "refusing", "lifecycle"):
    pytest.register_assert_rewrite(f"{__name__}.{_module}")

from .bench import Bench as Bench
from .conformance import DriverConformance as DriverConformance
from .harness import DriveHarness as DriveHarness

__all__ = ["Bench", "DriveHarness", "DriverConformance"]
