"""What the documents show is run, on a simulated robot."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from support.command import PROGRAM, TIMEOUT_S
from wheelwire import WheelwireError, open_driver
from wheelwire.drivers.mock import MockDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

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
            timeout=TIMEOUT_S,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        assert simulator.get("true.distance_m") == pytest.approx(0.4, abs=0.1)
        assert simulator.get("true.heading_rad") == pytest.approx(1.0, abs=0.25)
        assert simulator.get("drive_on") == 0
    assert "DRIVING" in result.stdout


@pytest.mark.parametrize("number", [0, -1])
def test_the_programs_for_python_drive(number: int) -> None:
    program = blocks("docs/python.md", "python")[number]
    assert PORT in program
    with Simulator() as simulator:
        carry_out([sys.executable, "-c", program.replace(PORT, simulator.port)])
        assert simulator.get("true.distance_m") > 0.2
        assert simulator.get("drive_on") == 0


def test_the_parameters_are_used_as_the_page_for_python_says() -> None:
    uses = blocks("docs/python.md", "python")[2]
    with Simulator() as simulator, open_driver("serial", port=simulator.port) as robot:
        results = [eval(line, {"robot": robot}) for line in uses.splitlines()]  # noqa: S307
    assert results[0] == 0.033
    assert results[2]["integral_gain"] == results[1]
    assert results[3] is True


def test_the_callbacks_are_used_as_the_page_for_python_says() -> None:
    program = blocks("docs/python.md", "python")[1]
    with MockDriver(realtime=False) as robot:
        rings: list[None] = []
        exec(program, {"robot": robot, "horn": lambda: rings.append(None)})  # noqa: S102
        robot.unplug()
        robot.plug()
        robot.advance(1.0)
        assert robot.parameters["max_duty"] == 0.5
        robot.simulator.set("left.encoder_dead", 1)
        for _ in range(100):
            with suppress(WheelwireError):
                robot.set_velocity(0.2, 0.0)
            robot.advance(0.05)
        assert rings == [None]


TUTORIAL = sorted(page.relative_to(ROOT).as_posix() for page in ROOT.glob("docs/tutorial/*.md"))
ROBOT = {"counts_per_revolution": 1440}
"""The simulated robot is the one that the tutorial measures."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(settings=ROBOT) as simulator:
        yield simulator


@pytest.mark.parametrize("page", TUTORIAL)
def test_the_tutorials_commands_and_programs_work(page: str, simulator: Simulator) -> None:
    """Page after page on one robot, as a reader does."""
    for language, text in re.findall(
        r"^```(sh|python)\n(.*?)^```$", (ROOT / page).read_text(), re.M | re.S
    ):
        text = text.replace(PORT, simulator.port)
        if language == "python":
            carry_out([sys.executable, "-c", text])
            continue
        for line in text.splitlines():
            program, *words = shlex.split(line)
            assert program == "wheelwire"
            limit = ["--seconds", "1"] if words[0] == "monitor" else []
            carry_out([*PROGRAM, *words, *limit])


def carry_out(command: list[str]) -> None:
    result = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert result.returncode == 0, (command, result.stderr)


def test_the_tutorials_way_to_the_feed_forward_finds_it() -> None:
    (_, program) = blocks("docs/tutorial/5-numbers.md", "python")
    with Simulator() as simulator:  # its counts are the default
        result = subprocess.run(
            [sys.executable, "-c", program.replace(PORT, simulator.port)],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=True,
        )
    found = float(result.stdout.split()[-1])
    assert found == pytest.approx(PARAMETER_BY_NAME["velocity_feedforward"].default, rel=0.03)
