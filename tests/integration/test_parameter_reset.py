"""`wheelwire params reset`: it asks, and writes a copy that `params import` takes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.command import check_error, output, run, run_json
from support.simulator_on_line import GOOD, simulator_on
from support.typing_terminal import TypingTerminal
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.state import state_folder

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


def test_twice_in_a_second_is_two_copies(simulator: Simulator, tmp_path: Path) -> None:
    first, second = (run_json("params", "reset", simulator.port, "--yes") for _ in range(2))
    assert first["copy"] != second["copy"]
    assert "max_duty: 0.5 duty" in Path(first["copy"]).read_text()
    assert "max_duty: 1 duty" in Path(second["copy"]).read_text()
    wanted = tmp_path / "here.yaml"
    assert run_json("params", "reset", simulator.port, "--yes", "--copy", str(wanted)) == {
        "reset": True,
        "copy": str(wanted),
    }
    assert len(copies()) == 2


@pytest.mark.parametrize(("answer", "resets"), [(b"y\n", True), (b"\n", False)])
def test_it_asks(simulator: Simulator, answer: bytes, *, resets: bool) -> None:
    with TypingTerminal("params", "reset", simulator.port, environment=WIDE) as person:
        person.wait_for("4 values differ from their defaults; what is saved is reset, too. ")
        assert b"board" not in person.output
        person.press(answer)
        assert person.wait() == (0 if resets else errors.InvalidArgument.exit_code)
    assert changed(simulator) is not resets
    assert len(copies()) == resets


def test_ctrl_c_at_the_question_resets_nothing(simulator: Simulator) -> None:
    with TypingTerminal("params", "reset", simulator.port, environment=WIDE) as person:
        person.wait_for("[y/N]")
        person.press(b"\x03")
        assert person.wait() == 130
        person.wait_for("interrupted; nothing was reset")
    assert changed(simulator)
    assert not copies()


def test_where_nobody_can_be_asked_nothing_is_reset(simulator: Simulator) -> None:
    line = check_error(run("params", "reset", simulator.port), errors.InvalidArgument)
    assert "add --yes. Nothing was reset" in line
    assert changed(simulator)


def test_a_copy_that_cannot_be_written_resets_nothing(simulator: Simulator, tmp_path: Path) -> None:
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
    assert changed(simulator)


def test_a_reset_that_is_refused_says_where_the_copy_is(simulator: Simulator) -> None:
    simulator.set("store_failing", 1)
    result = run("params", "reset", simulator.port, "--yes")
    assert result.returncode == errors.DeviceRefused.exit_code
    (copy,) = copies()
    assert f"a copy of the values is in {copy}" in result.stderr


def test_a_robots_file_does_not_get_into_the_copy(simulator: Simulator, tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        f"driver: serial\nserial: {{port: {simulator.port}}}\nparameters: {{max_duty: 0.25}}\n"
    )
    copy = run_json("params", "reset", str(file), "--yes")["copy"]
    assert "max_duty: 0.5 duty" in Path(copy).read_text()


def test_a_user_without_a_home_is_asked_for_a_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def nobody() -> Path:
        raise RuntimeError

    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr(Path, "home", nobody)
    with pytest.raises(errors.OutputFailed, match="XDG_STATE_HOME"):
        state_folder()
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    assert state_folder() == tmp_path / ".local" / "state" / "wheelwire"


def test_a_cable_that_is_pulled_at_the_question_resets_nothing(simulator: Simulator) -> None:
    with TypingTerminal("params", "reset", simulator.port, environment=WIDE) as person:
        person.wait_for("[y/N]")
        simulator.unplug()
        person.press(b"y\n")
        assert person.wait() in (errors.LinkLost.exit_code, errors.RequestTimeout.exit_code)
    simulator.plug()
    assert changed(simulator)
    (copy,) = copies()
    assert str(copy).encode() in person.output
