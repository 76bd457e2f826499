"""`wheelwire params reset`: it asks, and writes a copy that `params import` takes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.command import check_error, output, run
from support.simulator_on_line import GOOD, simulator_on
from support.typing_terminal import TypingTerminal
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator

WIDE = {"COLUMNS": "500"}
"""A question is one line."""
VALUES = {"max_duty": 0.5, "integral_gain": 12.0, "wheel_radius": 0.04}


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    """With values that are saved, and one that is only tried."""
    with simulator_on(GOOD) as simulator:
        with SerialDriver(simulator.port) as robot:
            robot.parameters.set_all(VALUES, save=True)
            robot.parameters.set("path_gain", 1.0)
        yield simulator


def values(simulator: Simulator) -> dict[str, float]:
    with SerialDriver(simulator.port) as robot:
        return dict(robot.parameters)


def changed(simulator: Simulator) -> bool:
    return VALUES.items() <= values(simulator).items()


def copies() -> list[Path]:
    return sorted(Path(os.environ["XDG_STATE_HOME"]).glob("wheelwire/params-*.yaml"))


def test_the_copy_brings_everything_back(simulator: Simulator) -> None:
    before = values(simulator)
    text = output("params", "reset", simulator.port, "--yes")
    (copy,) = copies()
    assert f"`wheelwire params import {simulator.port} {copy} --save`" in text
    simulator.reset()
    assert not changed(simulator)
    output("params", "import", simulator.port, str(copy), "--save")
    simulator.reset()
    assert values(simulator) == before


@pytest.mark.parametrize(
    ("answer", "code", "said"),
    [
        (b"y\n", 0, "reset"),
        (b"\n", errors.InvalidArgument.exit_code, ""),
        (b"\x03", 130, "interrupted; nothing was reset"),
    ],
)
def test_it_asks(simulator: Simulator, answer: bytes, code: int, said: str) -> None:
    with TypingTerminal("params", "reset", simulator.port, environment=WIDE) as person:
        person.wait_for("4 values differ from their defaults; what is saved is reset, too. ")
        assert b"board" not in person.output
        person.press(answer)
        assert person.wait() == code
        person.wait_for(said)
    assert changed(simulator) is bool(code)
    assert len(copies()) == (not code)


def test_without_a_copy_or_an_answer_nothing_is_reset(simulator: Simulator, tmp_path: Path) -> None:
    there = tmp_path / "there.yaml"
    there.write_text("mine")
    blocked = tmp_path / "file"
    blocked.touch()
    reset = ("params", "reset", simulator.port, "--yes")
    for options, environment, reason in (
        (("--copy", str(there)), {}, f"{there} exists"),
        (("--copy", str(tmp_path / "no" / "copy.yaml")), {}, "No such file or directory"),
        (("--copy", "/dev/full"), {}, "/dev/full exists"),
        ((), {"XDG_STATE_HOME": str(blocked)}, f"{blocked}"),
    ):
        line = check_error(run(*reset, *options, **environment), errors.OutputFailed)
        assert reason in line
        assert "nothing was reset: name another file with --copy" in line
    assert there.read_text() == "mine"
    line = check_error(run("params", "reset", simulator.port), errors.InvalidArgument)
    assert "add --yes. Nothing was reset" in line
    assert changed(simulator)


def test_a_reset_that_is_refused_says_where_the_copy_is(simulator: Simulator) -> None:
    simulator.set("store_failing", 1)
    result = run("params", "reset", simulator.port, "--yes")
    assert result.returncode == errors.DeviceRefused.exit_code
    (copy,) = copies()
    assert f"a copy of the values is in {copy}" in result.stderr
