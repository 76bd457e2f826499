"""`wheelwire setup` on a pseudo-terminal: a person is asked, interrupts it, or kills it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import mkdtemp

import pytest

from support.typing_terminal import TypingTerminal
from support.waiting import wait_until
from support.wrong_wiring import FOUND, SETTINGS, values
from wheelwire import open_driver
from wheelwire.board import ImuSensor
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import ConfigurationState
from wheelwire_protocol.peripherals import Axis

pytestmark = pytest.mark.early


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(settings=SETTINGS) as simulator:
        yield simulator


def hand_is_off(simulator: Simulator, side: str) -> bool:
    return simulator.get(f"{side}.hand_turns") == 0.0


@contextmanager
def person(simulator: Simulator, state: Path) -> Iterator[TypingTerminal]:
    """A person at a terminal, who was asked for the first time."""
    environment = {"XDG_STATE_HOME": str(state)}
    with TypingTerminal("setup", simulator.port, environment=environment) as terminal:
        if simulator.get("board_unwritten"):
            terminal.wait_for("Which board is it?")
            terminal.press(b"\n")
            terminal.wait_for("confirmed")
        else:  # the image's own board has no IMU
            terminal.wait_for("Find how the IMU")
            terminal.press(b"n\n")
        terminal.wait_for("hang free")
        terminal.press(b"y\n")
        yield terminal


def test_a_person_is_asked(tmp_path: Path) -> None:
    # Each run has its own robot and folder: a run that stalls is started again.
    with Simulator(settings={**SETTINGS, "board_unwritten": 1}) as simulator:
        answer_everything(simulator, state_folder(tmp_path))
        saved = values(simulator)
    assert {name: saved[name] for name in FOUND} == FOUND


def state_folder(parent: Path) -> Path:
    return Path(mkdtemp(dir=parent))


def answer_everything(simulator: Simulator, state: Path) -> None:
    with person(simulator, state) as terminal:
        terminal.wait_for("Which wheel turned")
        terminal.press(b"up\n")
        terminal.wait_for("answer with left forward")
        terminal.press(b"\n")  # once more
        terminal.wait_for("Which wheel turned", 3)
        terminal.press(b"lf\n")
        terminal.wait_for("the other wheel turn?")
        terminal.press(b"backward\n")
        terminal.wait_for("Ticks per wheel turn")
        terminal.press(b"\n")
        for side in ("left", "right"):
            terminal.wait_for(f"Mark the {side} wheel")
            simulator.set(f"{side}.hand_turns", 10.0)
            turned = partial(hand_is_off, simulator, side)
            wait_until(turned, 20.0)
            terminal.press(b"\n")
        terminal.wait_for("Radius")
        terminal.press(b"0.0325\n")
        terminal.wait_for("middle of one tyre")
        terminal.press(b"0.14\n")
        assert b"the wheels turn: " in terminal.output
        assert b" s left" in terminal.output
        terminal.wait_for("tune the velocity loop?")
        terminal.press(b"no\n")
        terminal.wait_for("Save them")
        terminal.press(b"yes\n")
        assert terminal.wait() == 0, terminal.output


def test_after_ctrl_c_the_robot_is_as_it_was_and_the_next_one_goes_on(
    simulator: Simulator, tmp_path: Path
) -> None:
    state = state_folder(tmp_path)
    with person(simulator, state) as terminal:
        terminal.wait_for("Which wheel turned")
        terminal.press(b"lf\n")
        terminal.wait_for("the other wheel turn?")
        terminal.press(b"b\n")
        terminal.wait_for("Ticks per wheel turn")
        terminal.press(b"\x03")
        assert terminal.wait() == 130
    with open_driver("serial", port=simulator.port) as robot:
        assert robot.parameters["encoders_swapped"] == 0
    assert simulator.get("stands_still")
    with person(simulator, state) as terminal:
        terminal.wait_for("Go on after wiring?")
        terminal.press(b"\n")
        terminal.wait_for("Ticks per wheel turn")
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.wait() == 143


def test_a_person_lifts_and_turns_a_robot_with_an_imu(tmp_path: Path) -> None:
    mounted = {"imu.forward": Axis.MINUS_X, "imu.up": Axis.Y, "imu.bias": 0.02}
    with Simulator(settings={"wheels_free": 1, **mounted}) as simulator:
        lift_and_turn(simulator, state_folder(tmp_path))
        with SerialDriver(simulator.port) as robot:
            state, board = robot.board.read()
            assert robot.parameters["rolling_velocity_mps"] == 0.25
    assert board is not None
    assert state is ConfigurationState.STORED
    entry = board.peripherals[0]
    assert isinstance(entry, ImuSensor)
    assert (entry.forward, entry.up) == (Axis.MINUS_X, Axis.Y)
    assert entry.bias == pytest.approx((0, 0.02, 0), abs=0.0005)


def lift_and_turn(simulator: Simulator, state: Path) -> None:
    """What was saved stays, though Ctrl-C ends the set-up after it."""

    def put_down() -> None:
        for name in ("tilt.roll_rad", "tilt.pitch_rad", "push.turn_radps"):
            simulator.set(name, 0)
        wait_until(
            lambda: not simulator.get("true.roll_rad") and not simulator.get("true.pitch_rad")
        )

    wide = {"XDG_STATE_HOME": str(state), "COLUMNS": "500"}
    with TypingTerminal("setup", simulator.port, environment=wide) as terminal:
        for question, name, value in (
            ("Find how the IMU (MPU6050) is mounted?", "", 0.0),
            ("Stand the robot on a level floor", "", 0.0),
            ("lift its front", "tilt.pitch_rad", -0.5),
            ("lift its left side", "tilt.roll_rad", 0.5),
            ("turn it to the left on the floor", "push.turn_radps", 1.0),
        ):
            terminal.wait_for(question)
            put_down()
            terminal.press(b"\n")
            if name:
                simulator.set(name, value)
        terminal.wait_for("Save this on the robot?")
        put_down()
        terminal.press(b"yes\n")
        terminal.wait_for("hang free")
        terminal.press(b"\x03")
        assert terminal.wait() == 130, terminal.output


def test_killed_it_leaves_a_robot_that_stands_and_is_as_it_was(
    simulator: Simulator, tmp_path: Path
) -> None:
    with person(simulator, state_folder(tmp_path)) as terminal:
        terminal.wait_for("Which wheel turned")
        terminal.press(b"lf\n")
        terminal.wait_for("the other wheel turn?")
        terminal.press(b"b\n")
        terminal.wait_for("Both wheels turn forward")
        terminal.process.kill()
        wait_until(lambda: not simulator.get("drive_on") and simulator.get("stands_still"))
    with open_driver("serial", port=simulator.port) as robot:
        assert robot.parameters["encoders_swapped"] == 0
        assert robot.parameters["right_motor_inverted"] == 0
