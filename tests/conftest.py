"""For all tests. Hypothesis measures no time: it says how busy the computer is."""

from __future__ import annotations

import itertools
import os
import signal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from wheelwire.link.tap_directory import DIRECTORY_VARIABLE as TAP_DIRECTORY
from wheelwire.link.tap_directory import GROUP_VARIABLE
from wheelwire.linux_mcu.latches import DIRECTORY_VARIABLE

os.environ.pop("WHEELWIRE_ROBOT", None)  # the robot of whoever runs the tests is none of theirs

# A shell starts what it puts into the background with Ctrl-C ignored, which children inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("wheelwire", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("wheelwire")


@pytest.fixture(autouse=True)
def _own_latches(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A test's robots on this computer's pins share no latched e-stop with another test's."""
    # Only by name: making a folder for each of thousands of tests takes time.
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(_directory(tmp_path_factory)))


@pytest.fixture(autouse=True)
def _own_taps(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A test's robots are not offered to the programs of whoever runs it."""
    folder = tmp_path_factory.getbasetemp() / f"taps-{next(_NUMBERS)}"
    monkeypatch.setenv(TAP_DIRECTORY, str(folder))
    monkeypatch.delenv(GROUP_VARIABLE, raising=False)


@pytest.fixture(autouse=True)
def _own_state(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """What a test's commands store for later is not among what its user has stored."""
    folder = tmp_path_factory.getbasetemp() / f"state-{next(_NUMBERS)}"
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))


def _directory(factory: pytest.TempPathFactory) -> Path:
    return factory.getbasetemp() / f"latches-{next(_NUMBERS)}"


_NUMBERS = itertools.count()
