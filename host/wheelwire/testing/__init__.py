"""The conformance tests that every driver passes, for authors of drivers. Needs pytest.

    from wheelwire.testing import Bench, DriverConformance

    class MyBench(Bench): ...

    class TestMyDriver(DriverConformance):
        @pytest.fixture
        def bench(self): yield MyBench()

An entry point in the group `wheelwire.drivers` makes the driver available to `open_driver` by name.

`harness` has the `Bench` that an author describes (a robot, and how to see and break it), and the
`DriveHarness` that commands its driver and waits for samples. `conformance` has all of the tests:
motion, samples, stops, refusals, loss and end. A bench opens the driver; the tests drive it through
the harness and compare its samples with what the bench sees. A test that needs something which a
bench lacks is skipped.
"""

import pytest

for _module in ("harness", "conformance"):
    pytest.register_assert_rewrite(f"{__name__}.{_module}")

from .conformance import DriverConformance as DriverConformance
from .harness import Bench as Bench
from .harness import DriveHarness as DriveHarness

__all__ = ["Bench", "DriveHarness", "DriverConformance"]
