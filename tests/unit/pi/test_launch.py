"""Starting the process that moves the pins, with another program in its place."""

import subprocess
import sys
from collections.abc import Sequence

import pytest

from wheelwire import errors
from wheelwire.pi import launch
from wheelwire.pi.pins import Pins
from wheelwire.pi.settings import McuSettings

HANGS_UP = "import os, sys, time; os.close(int(sys.argv[1])); time.sleep(60)"


def test_a_process_that_hangs_up_at_its_start_and_does_not_end_is_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start, started = launch.start, []

    def start_other(_command: Sequence[str], fd: int) -> subprocess.Popen[bytes]:
        started.append(start([sys.executable, "-c", HANGS_UP, str(fd)], fd))
        return started[0]

    monkeypatch.setattr(launch, "start", start_other)
    monkeypatch.setattr(launch, "EXIT_TIMEOUT_S", 0.05)
    with pytest.raises(errors.DriverUnavailable, match="ended at its start with status -"):
        launch.launch(McuSettings(backend="l298n", board=Pins()))
    assert started[0].returncode is not None
