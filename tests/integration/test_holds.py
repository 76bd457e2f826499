"""A robot alone says what holds it, and which program died while it drove."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

import wheelwire
from support.command import run, run_json
from support.processes import talking
from wheelwire.log.why.diagnosis import Stop
from wheelwire.simulation.simulator import Simulator

pytestmark = pytest.mark.timeout(120)

DRIVES = """
import sys
import wheelwire
with wheelwire.connect(sys.argv[1]) as robot:
    while True:
        robot.set_velocity(0.2, 0.0, ttl=0.3)
        sample = robot.read()
        if sample.left_mps > 0.1:
            print("drives", flush=True)
"""


def test_after_a_kill_it_names_the_deadline_and_the_program_that_died(tmp_path: Path) -> None:
    with Simulator(link=tmp_path / "port") as simulator:
        with talking(sys.executable, "-c", DRIVES, simulator.port) as (program, line):
            assert line == "drives\n"
            time.sleep(1.2)  # it is remembered within a second of its session
        time.sleep(1.0)  # its setpoint runs out
        (stop,) = run_json("why", simulator.port)
        assert stop["cause"] == "host_killed"
        evidence = " ".join(stop["evidence"])
        assert "The setpoint of the program that drove expired" in evidence
        assert f"process {program.pid}, which has ended" in evidence
        assert "wheelwire.connect" in evidence
        assert stop["time"] is not None
        assert "Nothing holds the robot: it is IDLE." in run("why", simulator.port).stdout
        found = run_json("info", simulator.port)
        assert found["held_by"] == []
        assert found["last_stop"]["cause"] == "DEADLINE"


def test_a_bumper_is_named_by_everything_without_its_samples(tmp_path: Path) -> None:
    stops: list[Stop] = []
    with (
        Simulator(link=tmp_path / "port") as simulator,
        wheelwire.connect(simulator.port) as robot,
    ):
        assert robot.has_device
        robot.watch_stops(stops.append)
        pressed = False
        end_s = time.monotonic() + 20.0
        while time.monotonic() < end_s and not stops:
            robot.set_velocity(0.2, 0.0, ttl=0.5)
            if robot.read().left_mps > 0.1 and not pressed:
                simulator.set("bumper.front_left", 1)
                pressed = True
        assert [stop.cause for stop in stops] == ["bumper_pressed"]
        # Beside the program that holds the port, too.
        text = run("why", simulator.port).stdout
        assert "BUMPER_FRONT_LEFT" in text
        assert "Bumper front left was pressed" in text
        assert "BUMPER_FRONT_LEFT" in run("info", simulator.port).stdout
        assert (
            "BUMPER_FRONT_LEFT"
            in run("monitor", simulator.port, "--plain", "--seconds", "1").stderr
        )
        assert not robot.sensors.channels
        # It asks for the samples, and names the sensor by them.
        assert "bumper.front_left has triggered" in run("doctor", simulator.port).stdout
