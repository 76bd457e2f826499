"""`wheelwire teleop` in a terminal of its own, with the simulated robot."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.command import run, run_json
from support.typing_terminal import TypingTerminal
from support.usb_ports import environment_with_ports
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire.tools.teleop.drive import STALE_S
from wheelwire.tools.teleop.keys import FIRST_LIFE_S
from wheelwire_protocol.codes import SupervisorState

PERIOD_US = 1000
"""The firmware's control period."""
UP = b"\x1b[A"


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(truth_hz=200) as simulator:
        yield simulator


@contextmanager
def teleop(simulator: Simulator, *, kitty: bool = False) -> Iterator[TypingTerminal]:
    """A terminal in which the command takes keys."""
    simulator.set("estop_open", 0)
    with TypingTerminal("teleop", simulator.port, "--speed", "5", kitty=kitty) as terminal:
        terminal.wait_for("speed 5: 0.20 m/s, 1.0 rad/s")
        if kitty:
            terminal.wait_for("a released key stops at once")
        simulator.take_states()
        yield terminal


def drives_by(terminal: TypingTerminal, simulator: Simulator, key: bytes = b"w") -> None:
    """Type a key until the robot moves: a key that waits for a busy computer is dropped."""
    for _ in range(20):
        terminal.press(key)
        try:
            wait_until(lambda: simulator.get("drive_on"), 1.0)
        except AssertionError:
            continue
        return
    pytest.fail(f"the robot never moved: {terminal.output!r}")


def stands(simulator: Simulator) -> None:
    wait_until(lambda: simulator.get("stands_still") and not simulator.get("drive_on"))


def drives_s(states: list[TrueState]) -> list[float]:
    """The lengths of all drives, on the device's clock."""
    lengths, start_us = [], None
    for state in states:
        if not state.drive_changed:
            continue
        if state.drive_on:
            start_us = state.device_us
        elif start_us is not None:
            lengths.append((state.drive_removed_us - start_us) / 1e6)
    return lengths


def test_a_key_drives_and_its_setpoint_ends_within_the_life_of_the_press(
    simulator: Simulator,
) -> None:
    before_m = simulator.get("true.x_m")
    with teleop(simulator) as terminal:
        drives_by(terminal, simulator)
        stands(simulator)
        lengths = drives_s(simulator.take_states())
        assert lengths
        assert max(lengths) <= FIRST_LIFE_S + PERIOD_US / 1e6
        assert simulator.get("true.x_m") > before_m
        terminal.press(b"q")
        assert terminal.wait() == 0
        assert terminal.attributes() == terminal.before


def test_a_held_arrow_drives_on_and_space_stops(simulator: Simulator) -> None:
    with teleop(simulator) as terminal:
        before_m = simulator.get("true.distance_m")
        terminal.hold(UP, 3.0)
        stands(simulator)
        # The command has asked for the sensors' samples.
        assert {one["state"] for one in run_json("sensors", simulator.port)} == {"OK"}
        assert simulator.get("true.distance_m") > before_m + 0.2  # 0.14 m are one press
        drives_by(terminal, simulator)
        terminal.press(b" ")
        stands(simulator)
        wait_until(lambda: simulator.get("state") == SupervisorState.IDLE)  # not: timed out
        terminal.wait_for("IDLE")


def test_e_latches_and_c_clears(simulator: Simulator) -> None:
    with teleop(simulator) as terminal:
        drives_by(terminal, simulator)
        terminal.press(b"e")
        wait_until(lambda: simulator.get("state") == SupervisorState.ESTOPPED)
        stands(simulator)
        terminal.wait_for("e-stop latched; c clears it")
        terminal.press(b"w")
        terminal.wait_for("Emergency stop is latched")
        assert not simulator.get("drive_on")
        terminal.press(b"c")
        terminal.wait_for("ESTOPPED cleared")
        drives_by(terminal, simulator)
        terminal.press(b"e")
        wait_until(lambda: simulator.get("state") == SupervisorState.ESTOPPED)
        terminal.press(b"q")
        terminal.wait_for(f"ESTOPPED remains latched; `wheelwire clear {simulator.port}` ends it")
        assert terminal.wait() == 0
    run("clear", simulator.port)


def test_keys_typed_while_it_was_stopped_start_nothing(simulator: Simulator) -> None:
    with teleop(simulator) as terminal:
        drives_by(terminal, simulator)
        os.kill(terminal.process.pid, signal.SIGSTOP)
        stands(simulator)  # by the deadline
        before_m = simulator.get("true.distance_m")
        terminal.press(b"w" * 10)
        time.sleep(2 * STALE_S)
        os.kill(terminal.process.pid, signal.SIGCONT)
        terminal.press(b"9")
        terminal.wait_for("speed 9:")  # it has read all keys
        assert simulator.get("true.distance_m") == before_m
        drives_by(terminal, simulator)


def sent(number: signal.Signals) -> Callable[[TypingTerminal], None]:
    return lambda terminal: os.kill(terminal.process.pid, number)


def pressed(key: bytes) -> Callable[[TypingTerminal], None]:
    return lambda terminal: terminal.press(key)


@pytest.mark.parametrize(
    ("end", "code", "kitty"),
    [
        (sent(signal.SIGTERM), 143, False),
        (sent(signal.SIGHUP), 129, True),
        (pressed(b"\x03"), 130, False),
        (pressed(b"\x1a"), 130, False),
        (pressed(b"\x1c"), 130, False),
    ],
)
def test_a_signal_or_ctrl_c_stops_the_robot_and_restores_the_terminal(
    simulator: Simulator, end: Callable[[TypingTerminal], None], code: int, *, kitty: bool
) -> None:
    with teleop(simulator, kitty=kitty) as terminal:
        drives_by(terminal, simulator)
        end(terminal)
        assert terminal.wait() == code
        assert terminal.attributes() == terminal.before
        wait_until(lambda: terminal.flags == [0])
    stands(simulator)


def test_a_closed_terminal_ends_it(simulator: Simulator) -> None:
    with teleop(simulator) as terminal:
        drives_by(terminal, simulator)
        terminal.hang_up()
        terminal.wait()
    stands(simulator)


def test_where_releases_are_reported_one_stops_at_once(simulator: Simulator) -> None:
    with teleop(simulator, kitty=True) as terminal:
        assert terminal.flags == [0, 11]
        drives_by(terminal, simulator, b"\x1b[119;1:3u\x1b[119u")
        terminal.press(b"\x1b[119;1:3u")
        stands(simulator)
        # By a stop; without it the state would be TIMED_OUT, or still DRIVING.
        wait_until(lambda: simulator.get("state") == SupervisorState.IDLE)
        terminal.press(b"\x1b[99;5u")  # Ctrl-C is a key there
        assert terminal.wait() == 130
        wait_until(lambda: terminal.flags == [0])
        assert terminal.attributes() == terminal.before


def test_a_lost_robot_is_reported_and_comes_back(tmp_path: Path) -> None:
    with Simulator(link=tmp_path / "robot") as robot, teleop(robot) as terminal:
        robot.unplug()
        terminal.press(b"w")
        terminal.wait_for("the port is gone")
        robot.plug()
        drives_by(terminal, robot)
        terminal.press(b"q")
        assert terminal.wait() == 0
        assert terminal.attributes() == terminal.before


def test_the_only_candidate_is_named_and_asked_for(simulator: Simulator, tmp_path: Path) -> None:
    environment = {"WHEELWIRE_ROBOT": "", **environment_with_ports(tmp_path, simulator.port)}
    with TypingTerminal("teleop", environment=environment) as terminal:
        terminal.wait_for("[y/N]")
        assert f"{simulator.port} is the only candidate".encode() in terminal.output
        terminal.press(b"y\n")
        terminal.wait_for(f"driving {simulator.port} (SIMULATED ")
        terminal.wait_for("speed 4:")
        terminal.press(b"q")
        assert terminal.wait() == 0
    with TypingTerminal("teleop", environment=environment) as terminal:
        terminal.wait_for("[y/N]")
        terminal.press(b"\n")
        assert terminal.wait() == errors.RobotNotNamed.exit_code
