"""What the documents show is run, on a simulated robot."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from support.command import PATIENCE_S
from wheelwire.sim import Simulator

ROOT = Path(__file__).parents[2]
PORT = "/dev/ttyUSB0"


def blocks(file: str, language: str) -> list[str]:
    """The fenced code blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", (ROOT / file).read_text(), re.M | re.S)


def test_the_readmes_program_drives() -> None:
    (program,) = blocks("README.md", "python")
    assert PORT in program
    with Simulator() as simulator:
        result = subprocess.run(
            [sys.executable, "-c", program.replace(PORT, simulator.port)],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        assert simulator.get("true.distance_m") == pytest.approx(0.4, abs=0.1)
        assert simulator.get("true.heading_rad") == pytest.approx(1.0, abs=0.25)
        assert simulator.get("drive_on") == 0
    assert "DRIVING" in result.stdout
