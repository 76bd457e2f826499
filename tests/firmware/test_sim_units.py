"""The C++ unit tests of the simulation's parts."""

from __future__ import annotations

import subprocess

from support.fwsim import library_path


def test_the_models_of_bridge_motor_counter_line_and_store() -> None:
    program = library_path().with_name("wheelwire-sim-test")
    result = subprocess.run([program], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
