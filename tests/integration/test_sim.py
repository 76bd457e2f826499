"""`wheelwire sim` to read along: what it says, and its wheels turned by hand."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.cases import each
from support.command import PROGRAM, TIMEOUT_S, check_error, output, run, run_json
from support.processes import talking
from support.typing_terminal import TypingTerminal
from support.waiting import wait_until
from wheelwire import errors

RAISED = ("--set", "wheels_free=1")


@contextmanager
def sim(link: Path, *options: str) -> Iterator[TypingTerminal]:
    """In a terminal, at which commands may be typed."""
    terminal = TypingTerminal("sim", "--link", str(link), *options, environment={"COLUMNS": "500"})
    with terminal:
        terminal.wait_for("What the wheels do:")
        yield terminal
        terminal.press(b"\x03")
        assert terminal.wait() == 0
    assert not link.exists()


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "robot"


def test_it_says_what_the_wheels_do(link: Path) -> None:
    with sim(link) as told:
        assert b"It stands on the floor (`--set wheels_free=1` raises it" in told.output
        assert b"a radius of 0.033 m and are 0.2 m apart" in told.output
        output("drive", str(link), "--linear", "0.2", "--seconds", "0.5")
        told.wait_for("both wheels turned forward 0.")
        output("drive", str(link), "--angular", "2", "--seconds", "0.5")
        told.wait_for("the left wheel turned backward 0.")


def test_a_wheel_is_turned_by_hand_and_let_go_whatever_ends_it(link: Path) -> None:
    with sim(link, *RAISED, "--faults", "noisy") as told:
        assert b"Its wheels hang free" in told.output
        text = output("sim", "turn", "left", "1.5")
        assert text == "the left wheel was turned forward by 1.5 turns\n"
        told.wait_for("the left wheel turned forward 1.50 turns")
        said = run_json("sim", "turn", "right", "-0.5", "--link", str(link))
        assert said == {"wheel": "right", "turns": -0.5}
        told.wait_for("the right wheel turned backward 0.50 turns")

        told.press(b"set left.blocked 1\nnonsense\n")
        told.wait_for("left.blocked = 1")
        told.wait_for("the simulator refused `nonsense`: not a command; see --help")
        result = run("sim", "turn", "left", "2")
        assert result.returncode == errors.WheelwireError.exit_code
        assert "the left wheel does not give way after 0.00 turns" in result.stderr
        told.press(b"get left.hand_turns\nset left.blocked 0\n")
        told.wait_for("left.hand_turns = 0")

        with TypingTerminal("sim", "turn", "left", "100") as hand:
            wait_until(lambda: _again(told, b"get left.hand_turns\n", b"left.hand_turns = 9"))
            line = check_error(run("sim", "turn", "left", "1"), errors.InvalidArgument)
            assert "somebody turns the left wheel already" in line
            hand.press(b"\x03")
            assert hand.wait() == 130
        assert output("sim", "turn", "left", "0.2")
        with TypingTerminal("sim", "turn", "right", "100") as hand:
            wait_until(lambda: _again(told, b"get right.hand_turns\n", b"right.hand_turns = 9"))
            told.press(b"quit\n")
            assert hand.wait() == errors.WheelwireError.exit_code
            hand.wait_for("the simulator has ended")


def _again(told: TypingTerminal, line: bytes, wanted: bytes) -> bool:
    told.press(line)
    return wanted in told.output


@each(
    ("words", "reason"),
    [
        ("middle 1", "middle is not a wheel: give left or right"),
        ("left 0", "0 turns: give a number from -1000 to 1000, and not 0"),
        ("left nan", "nan turns"),
        ("right -1001", "-1001 turns"),
    ],
)
def test_a_turn_that_cannot_be(words: str, reason: str) -> None:
    assert reason in check_error(run("sim", "turn", *words.split()), errors.InvalidArgument)


def test_no_simulator_and_two(link: Path, tmp_path: Path) -> None:
    turn = ("sim", "turn", "left", "0.1")
    line = check_error(run(*turn), errors.SimulatorNotFound)
    assert "no simulator that can be turned by hand runs: start `wheelwire sim`" in line
    other = tmp_path / "other"
    with sim(link, *RAISED), sim(other, *RAISED):
        line = check_error(run(*turn), errors.SimulatorNotFound)
        assert "2 simulators run, at " in line
        assert str(link) in line
        assert str(other) in line
        assert "name one by --link" in line
        assert run(*turn, "--link", str(other)).returncode == 0
        line = check_error(run(*turn, "--link", "/nowhere"), errors.SimulatorNotFound)
        assert "runs at /nowhere; one does at " in line
    assert run(*turn).returncode == errors.SimulatorNotFound.exit_code


def test_a_killed_simulator_is_not_found(link: Path) -> None:
    with talking(*PROGRAM, "sim", "--link", link):
        wait_until(lambda: run("sim", "turn", "left", "0.1").returncode == 0)
    check_error(run("sim", "turn", "left", "0.1"), errors.SimulatorNotFound)
    wait_until(lambda: not link.exists())


def test_several_signals_at_once_end_it_too(link: Path) -> None:
    """As `timeout` sends them, to the program and to its group."""
    with talking(*PROGRAM, "sim", "--link", link, "--faults", "noisy") as (told, _):
        for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            told.send_signal(number)
        told.communicate(timeout=TIMEOUT_S)
    assert told.returncode == 0
    assert not link.exists()


def test_an_unknown_variable_is_refused(link: Path) -> None:
    result = run("sim", "--link", str(link), "--set", "colour=1")
    assert result.returncode == errors.WheelwireError.exit_code
    assert "cannot set colour; see --help for names and bounds" in result.stderr
    line = check_error(run("sim", "--set", "mass_kg"), errors.InvalidArgument)
    assert "give NAME=VALUE, with a number" in line
