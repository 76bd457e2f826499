"""`wheelwire restart`: what a restart keeps, what it loses, and when it is refused."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator

import pytest

from support.command import PROGRAM, TIMEOUT_S, output, run_json
from support.simulator_on_line import GOOD, simulator_on
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.simulation.simulator import Simulator


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with simulator_on("noisy") as simulator:
        yield simulator


def test_it_is_back_with_what_was_saved(simulator: Simulator) -> None:
    run_json("params", "set", simulator.port, "max_duty", "0.5", "--save")
    run_json("params", "set", simulator.port, "wheel_radius", "0.05")
    before = simulator.get("boot_id")
    text = output("restart", simulator.port)
    assert simulator.get("boot_id") != before
    assert f"Robot at {simulator.port} is back" in text
    assert "The firmware restarted itself." in text
    assert "IDLE" in text
    values = {p["name"]: p["value"] for p in run_json("params", "list", simulator.port)}
    assert values["max_duty"] == 0.5
    assert values["wheel_radius"] == pytest.approx(0.033)


def test_a_device_that_is_unplugged_meanwhile_does_not_come_back() -> None:
    with simulator_on(GOOD) as simulator:
        before = simulator.get("boot_id")
        with subprocess.Popen(
            [*PROGRAM, "restart", simulator.port], stderr=subprocess.PIPE, text=True
        ) as command:
            wait_until(lambda: simulator.get("boot_id") != before)
            simulator.close()
            said = command.communicate(timeout=TIMEOUT_S)[1]
    assert command.returncode == errors.LinkLost.exit_code, said
    assert "did not come back within 8 s of its restart" in said
    assert "switch its power off" in said
