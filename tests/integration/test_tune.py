"""`wheelwire tune`: two drives side by side, and what becomes of the values that were tried."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.cases import each
from support.command import PROGRAM, TIMEOUT_S, check_error, run
from support.simulator_on_line import GOOD, simulator_on
from support.typing_terminal import TypingTerminal
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator

WIDE = {"COLUMNS": "500"}
BETTER = ("--velocity-feedforward", "1.365", "--ki", "16")
"""The defaults, of a robot that has worse ones."""
WORSE = {"velocity_feedforward": 0.9, "integral_gain": 4.0}
SHORT = ("--seconds", "1.5")


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    """Whose gains are bad, and saved."""
    with simulator_on(GOOD) as simulator:
        with SerialDriver(simulator.port) as robot:
            robot.parameters.set_all(WORSE, save=True)
        yield simulator


HELD_UP = "setpoints came late in a drive, as this computer or the line is busy"


def not_held_up(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The command's result, as soon as this machine left it the time for its drives."""
    results = []

    def is_comparable() -> bool:
        results.append(run(*arguments))
        return HELD_UP not in results[-1].stdout + results[-1].stderr

    wait_until(is_comparable)
    return results[-1]


def gains(simulator: Simulator, *, after_reset: bool = False) -> dict[str, float]:
    if after_reset:
        simulator.reset()
    with SerialDriver(simulator.port) as robot:
        return {name: robot.parameters[name] for name in WORSE}


def test_both_drives_are_side_by_side_and_drawn(simulator: Simulator, tmp_path: Path) -> None:
    picture = tmp_path / "drives.png"
    words = ("tune", simulator.port, "--yes", *SHORT, *BETTER, "--plot", str(picture))
    result = not_held_up(*words)
    assert result.returncode == 0, result.stderr
    text = result.stdout
    for word in ("before", "after", "left rms error", "right rise time", "overshoot", "settling"):
        assert word in text
    assert "the new values track better by" in text
    assert "integral_gain: 4 -> 16 duty/m" in text
    assert "undone: the previous values are active again" in text
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert gains(simulator) == pytest.approx(WORSE)
    assert simulator.get("stands_still")


def test_a_script_saves_what_is_better_and_not_what_is_worse(simulator: Simulator) -> None:
    words = ("tune", simulator.port, "--yes", *SHORT, "--save", "--json")
    result = not_held_up(*words, *BETTER)
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    assert said["outcome"] == "save"
    assert said["held_up"] is False
    assert said["after"]["left"]["rms_mps"] < said["before"]["left"]["rms_mps"]
    assert said["gain_mps"] > said["noise_mps"]
    assert said["values"]["integral_gain"] == {"before": 4.0, "after": 16.0}
    good = gains(simulator, after_reset=True)
    assert good == pytest.approx({"velocity_feedforward": 1.365, "integral_gain": 16.0})
    back = [f"--{name.replace('_', '-')}={value}" for name, value in WORSE.items()]
    result = not_held_up(*words, *back)
    assert result.returncode == errors.CommissioningFailed.exit_code
    assert json.loads(result.stdout)["outcome"] == "undo"
    assert "track worse and were not saved" in json.loads(result.stderr)["message"]
    assert gains(simulator) == good


@pytest.mark.parametrize(
    ("answer", "now", "later"),
    [("keep", True, False), ("", False, False), ("save", True, True)],
)
def test_a_person_decides(simulator: Simulator, answer: str, *, now: bool, later: bool) -> None:
    with TypingTerminal("tune", simulator.port, *SHORT, *BETTER, environment=WIDE) as person:
        person.wait_for("Is the robot raised, or is there enough space? [y/N]")
        assert b"A step of both wheels to 0.2 m/s, 1.5 s, twice." in person.output
        assert simulator.get("true.distance_m") == 0.0
        person.press(b"y\n")
        person.wait_for("What now (keep, undo, save)? [undo]:")
        person.press(b"what\n")
        person.wait_for("answer keep, undo, save")
        person.press(f"{answer}\n".encode())
        assert person.wait() == 0
    assert (gains(simulator)["integral_gain"] == 16.0) is now
    assert (gains(simulator, after_reset=True)["integral_gain"] == 16.0) is later


@pytest.mark.parametrize("answer", [b"\n", b"\x03"])
def test_without_a_yes_nothing_moves(simulator: Simulator, answer: bytes) -> None:
    with TypingTerminal("tune", simulator.port, *BETTER, environment=WIDE) as person:
        person.wait_for("[y/N]")
        person.press(answer)
        assert person.wait() != 0
    assert simulator.get("true.distance_m") == 0.0
    line = check_error(run("tune", simulator.port), errors.InvalidArgument)
    assert "add --yes" in line
    assert simulator.get("true.distance_m") == 0.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_whatever_ends_it_the_wheels_stop_and_the_values_are_back(
    simulator: Simulator, number: signal.Signals
) -> None:
    words = ("--seconds", "20", "--distance", "5", *BETTER)
    with subprocess.Popen(
        [*PROGRAM, "tune", simulator.port, "--yes", *words], stderr=subprocess.PIPE, text=True
    ) as command:
        wait_until(lambda: simulator.get("true.distance_m") > 0.1)
        command.send_signal(number)
        said = command.communicate(timeout=TIMEOUT_S)[1]
    if number is not signal.SIGKILL:
        assert "stopped; the previous values are active again" in said
    wait_until(lambda: bool(simulator.get("stands_still")))
    wait_until(lambda: gains(simulator) == pytest.approx(WORSE))


@each(
    ("words", "error", "reason"),
    [
        ("--shape square", errors.InvalidArgument, "--shape square: give step, ramp, sine"),
        ("--wheel middle", errors.InvalidArgument, "give left, right, both"),
        ("--speed 0", errors.InvalidArgument, "a speed in m/s that is not 0"),
        ("--speed nan", errors.InvalidArgument, "a speed in m/s that is not 0"),
        ("--speed 3", errors.InvalidArgument, "beyond the robot's max_velocity_mps"),
        ("--seconds 1e9", errors.InvalidArgument, "--seconds 1e+09: give 0.2 to 60"),
        ("--distance 0", errors.InvalidArgument, "--distance 0: give 0.01 to 20"),
        ("--kp -1", errors.ParameterOutOfRange, "proportional_gain"),
        ("--ki nan", errors.ParameterOutOfRange, "integral_gain"),
        ("--save", errors.InvalidArgument, "nothing to save: give a gain"),
        ("--plot p.nothing", errors.InvalidArgument, "name it .png"),
        ("--plot /no/p.png", errors.OutputFailed, "cannot write /no/p.png"),
    ],
)
def test_an_impossible_request_is_refused_before_anything_moves(
    words: str, error: type[errors.WheelwireError], reason: str
) -> None:
    assert reason in check_error(run("tune", "mock", "--yes", *words.split()), error)
