"""A computer's I2C buses with made-up chips, for processes that use smbus2."""

from __future__ import annotations

import os
from pathlib import Path

from .stand_in import TESTS

SITE = TESTS / "support" / "i2c_site"
DIRECTORY = "WHEELWIRE_TEST_I2C"


class I2cBuses:
    """One bus, number 1. What is wrong with it is a file in its directory; see `i2c_site`.

    Args:
        directory: An empty one.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        directory.mkdir()
        self.set("bus-1")

    def environment(self, python_path: str) -> dict[str, str]:
        """That of processes that are to use them, which also have this PYTHONPATH."""
        path = os.pathsep.join([str(SITE), python_path])
        return {DIRECTORY: str(self._directory), "PYTHONPATH": path}

    def set(self, fault: str) -> None:
        """Something is wrong from now on."""
        (self._directory / fault).touch()

    def clear(self, fault: str) -> None:
        """It is right again."""
        (self._directory / fault).unlink()
