"""`wheelwire start`: from a new board to the first drive, at a terminal."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from support.command import check_error, run
from support.typing_terminal import TypingTerminal
from wheelwire import errors
from wheelwire.simulation.simulator import Simulator


def test_a_new_board_is_led_to_its_first_drive(tmp_path: Path) -> None:
    with Simulator(settings={"board_unwritten": 1}) as simulator:
        state = {"XDG_STATE_HOME": str(tmp_path)}
        with TypingTerminal("start", simulator.port, environment=state) as terminal:
            terminal.wait_for("2/5 Firmware")
            terminal.wait_for("done already: firmware")
            terminal.wait_for("Look at the driver board")
            terminal.press(b"\n")
            terminal.wait_for("Is the robot wired like this")
            terminal.press(b"y\n")
            terminal.wait_for("Find the wiring")
            terminal.press(b"perhaps\n")
            terminal.wait_for("answer with yes or skip")
            terminal.press(b"skip\n")
            terminal.wait_for("Drive 20 cm")
            terminal.press(b"yes\n")
            assert terminal.wait() == 0, terminal.output
        assert b"Next: `wheelwire teleop" in terminal.output
        assert simulator.get("true.distance_m") == pytest.approx(0.2, abs=0.02)


@pytest.mark.fast
def test_steps_that_are_done_say_so_and_the_set_up_is_reached(tmp_path: Path) -> None:
    state = {"XDG_STATE_HOME": str(tmp_path)}
    with Simulator(settings={"wheels_free": 1}) as simulator:
        assert run("params", "set", simulator.port, "wheel_radius", "0.04").returncode == 0
        with TypingTerminal("start", simulator.port, environment=state) as terminal:
            terminal.wait_for("Set it up again?")
            assert b"done already: L298N" in terminal.output
            assert b"wheel_radius 0.04" in terminal.output
            terminal.press(b"yes\n")
            terminal.wait_for("Find how the IMU")
            terminal.press(b"\x03")
            assert terminal.wait() == 130


def test_on_an_empty_board_it_ends_before_the_steps_that_need_firmware() -> None:
    ours, board = os.openpty()
    port = os.ttyname(board)
    with TypingTerminal("start", port) as terminal:
        terminal.wait_for("or `skip`")  # whether a checkout has built one or not
        terminal.press(b"skip\n")
        terminal.wait_for("The other steps need the firmware")
        assert terminal.wait() == 0, terminal.output
    assert f"run `wheelwire start {port}` again" in " ".join(terminal.output.decode().split())
    os.close(ours)
    os.close(board)


@pytest.mark.fast
def test_a_robot_that_ends_with_the_command_is_refused() -> None:
    with TypingTerminal("start", "mock") as terminal:
        assert terminal.wait() == errors.InvalidArgument.exit_code
        terminal.wait_for("start `wheelwire sim`")


@pytest.mark.fast
def test_it_needs_somebody_to_ask() -> None:
    assert "run it in a terminal" in check_error(run("start"), errors.InvalidArgument)
