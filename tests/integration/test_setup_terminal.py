"""`wheelwire setup` on a pseudo-terminal: a person is asked, interrupts it, or kills it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from support.typing_terminal import TypingTerminal
from support.waiting import wait_until
from support.wrong_wiring import FOUND, SETTINGS, values
from wheelwire import open_driver
from wheelwire.simulation.simulator import Simulator

pytestmark = pytest.mark.early


WHEELS = ("Which wheel turned", b"lf\n"), ("the other wheel turn?", b"b\n")
"""What a person answers who sees them."""


def answer(terminal: TypingTerminal, *dialogue: tuple[str, bytes]) -> None:
    for question, keys in dialogue:
        terminal.wait_for(question)
        terminal.press(keys)


@contextmanager
def person(simulator: Simulator, state: Path) -> Iterator[TypingTerminal]:
    """A person at a terminal, who was asked for the first time."""
    environment = {"XDG_STATE_HOME": str(state)}
    with TypingTerminal("setup", simulator.port, environment=environment) as terminal:
        if simulator.get("board_unwritten"):
            answer(terminal, ("Which board is it?", b"\n"))
            terminal.wait_for("confirmed")
        else:  # the image's own board has no IMU
            answer(terminal, ("Find how the IMU", b"n\n"))
        answer(terminal, ("hang free", b"y\n"))
        yield terminal


def test_a_person_is_asked(tmp_path: Path) -> None:
    with (
        Simulator(settings={**SETTINGS, "board_unwritten": 1}) as simulator,
        person(simulator, tmp_path) as terminal,
    ):
        answer(terminal, ("Which wheel turned", b"up\n"))
        answer(terminal, ("answer with left forward", b"\n"))  # once more
        terminal.wait_for("Which wheel turned", 3)
        answer(terminal, *WHEELS, ("Ticks per wheel turn", b"\n"))
        for side in ("left", "right"):
            terminal.wait_for(f"Mark the {side} wheel")
            simulator.set(f"{side}.hand_turns", 10.0)
            wait_until(partial(hand_is_off, simulator, side), 20.0)
            terminal.press(b"\n")
        answer(terminal, ("Radius", b"0.0325\n"), ("middle of one tyre", b"0.14\n"))
        assert b"the wheels turn: " in terminal.output
        assert b" s left" in terminal.output
        answer(terminal, ("tune the velocity loop?", b"no\n"), ("Save them", b"yes\n"))
        assert terminal.wait() == 0, terminal.output
        saved = values(simulator)
    assert {name: saved[name] for name in FOUND} == FOUND


def hand_is_off(simulator: Simulator, side: str) -> bool:
    return simulator.get(f"{side}.hand_turns") == 0.0


def test_killed_or_interrupted_it_leaves_the_robot_as_it_was_and_the_next_one_goes_on(
    tmp_path: Path,
) -> None:
    def is_as_it_was() -> None:
        wait_until(lambda: not simulator.get("drive_on") and simulator.get("stands_still"))
        with open_driver("serial", port=simulator.port) as robot:
            assert robot.parameters["encoders_swapped"] == 0
            assert robot.parameters["right_motor_inverted"] == 0

    with Simulator(settings=SETTINGS) as simulator:
        with person(simulator, tmp_path / "killed") as terminal:
            answer(terminal, *WHEELS)
            terminal.wait_for("Both wheels turn forward")
            terminal.process.kill()
            terminal.wait()  # until then it has the port
            is_as_it_was()
        with person(simulator, tmp_path) as terminal:
            answer(terminal, *WHEELS, ("Ticks per wheel turn", b"\x03"))
            assert terminal.wait() == 130
        is_as_it_was()
        with person(simulator, tmp_path) as terminal:
            answer(terminal, ("Go on after wiring?", b"\n"))
            terminal.wait_for("Ticks per wheel turn")
            terminal.process.send_signal(signal.SIGTERM)
            assert terminal.wait() == 143
