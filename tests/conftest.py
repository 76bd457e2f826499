"""For all tests. Hypothesis measures no time: it says how busy the computer is."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from wheelwire.linux_mcu.latches import DIRECTORY_VARIABLE

os.environ.pop("WHEELWIRE_ROBOT", None)  # the robot of whoever runs the tests is none of theirs

settings.register_profile("wheelwire", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("wheelwire")


@pytest.fixture(autouse=True)
def _own_latches(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A test's robots on this computer's pins share no latched e-stop with another test's."""
    # Only by name: making a folder for each of thousands of tests takes time.
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(_directory(tmp_path_factory)))


def _directory(factory: pytest.TempPathFactory) -> Path:
    return factory.getbasetemp() / f"latches-{next(_NUMBERS)}"


_NUMBERS = itertools.count()
