"""What works where a part of the installation is missing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from wheelwire.simulation.simulator import Simulator

TIMEOUT_S = 60.0

DRIVE = """
import sys
for missing in {missing!r}:
    sys.modules[missing] = None
import wheelwire
from wheelwire_protocol.decoder import Decoder
with wheelwire.open_driver({driver!r}, {options}) as robot:
    for _ in range(10):
        robot.set_velocity(0.1, 0.0, ttl=0.9)
        sample = robot.read()
print(Decoder.__name__, sample.state.name)
"""


def run(script: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )


def test_a_driver_opens_without_numpy_and_construct() -> None:
    missing = ["numpy", "construct", "crcmod", "yaml", "rich", "typer"]
    result = run(DRIVE.format(missing=missing, driver="mock", options=""))
    assert result.stdout.split() == ["NativeDecoder", "DRIVING"], result.stderr


def test_without_the_library_a_serial_robot_is_driven_all_the_same(tmp_path: Path) -> None:
    with Simulator() as simulator:
        script = DRIVE.format(missing=[], driver="serial", options=f"port={simulator.port!r}")
        result = run(script, WHEELWIRE_CORE=str(tmp_path / "missing.so"))
    assert result.stdout.split() == ["PythonDecoder", "DRIVING"], result.stderr
