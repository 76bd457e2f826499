"""`wheelwire monitor` in terminals: signals, a closed window, sizes, and tmux."""

from __future__ import annotations

import shlex
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("textual")
from support.command import PROGRAM, run_json
from support.typing_terminal import TypingTerminal
from support.waiting import wait_until
from wheelwire.simulation.simulator import Simulator

SCREEN = "space stop"
"""A part of the last line: the screen is there."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator() as simulator:
        yield simulator


def view(simulator: Simulator, *arguments: str) -> TypingTerminal:
    return TypingTerminal("monitor", simulator.port, *arguments, size=(80, 24))


def begin_to_drive(terminal: TypingTerminal, simulator: Simulator) -> None:
    terminal.wait_for(SCREEN)
    terminal.press(b"t")
    terminal.wait_for("y drives")
    terminal.press(b"y")
    terminal.wait_for("keys drive")
    for _ in range(100):
        terminal.press(b"w")
        time.sleep(0.1)
        if simulator.get("drive_on"):
            return
    pytest.fail(f"the robot never moved: {terminal.output[-2000:]!r}")


def stands(simulator: Simulator) -> None:
    wait_until(lambda: simulator.get("stands_still") and not simulator.get("drive_on"))


@pytest.fixture
def terminal(simulator: Simulator) -> Iterator[TypingTerminal]:
    with view(simulator) as terminal:
        yield terminal


def test_q_ends_it_and_leaves_the_terminal_as_it_was(
    simulator: Simulator, terminal: TypingTerminal
) -> None:
    terminal.wait_for(SCREEN)
    assert terminal.attributes() != terminal.before
    # The command has asked for the sensors' samples.
    assert {one["state"] for one in run_json("sensors", simulator.port)} == {"OK"}
    terminal.press(b"q")
    assert terminal.wait() == 0
    assert terminal.attributes() == terminal.before


def test_it_ends_although_the_kernel_continues_it_meanwhile(terminal: TypingTerminal) -> None:
    """As when a window is closed while it ends: a process that loses its terminal gets SIGCONT."""
    terminal.wait_for(SCREEN)
    terminal.process.send_signal(signal.SIGTERM)
    end_s = time.monotonic() + 20.0
    while terminal.process.poll() is None:
        assert time.monotonic() < end_s
        terminal.process.send_signal(signal.SIGCONT)
        time.sleep(0.01)
    assert terminal.process.returncode == 143


@pytest.mark.parametrize(
    ("end", "code"),
    [
        (lambda terminal: terminal.press(b"\x03"), 130),
        (lambda terminal: terminal.process.send_signal(signal.SIGTERM), 143),
        (lambda terminal: terminal.process.send_signal(signal.SIGHUP), 129),
    ],
)
def test_ctrl_c_or_a_signal_stops_the_wheels_and_has_its_exit_code(
    simulator: Simulator,
    terminal: TypingTerminal,
    end: Callable[[TypingTerminal], None],
    code: int,
) -> None:
    begin_to_drive(terminal, simulator)
    end(terminal)
    assert terminal.wait() == code
    assert terminal.attributes() == terminal.before
    stands(simulator)


def test_a_closed_window_stops_the_wheels_and_ends_it(
    simulator: Simulator, terminal: TypingTerminal
) -> None:
    begin_to_drive(terminal, simulator)
    terminal.hang_up()
    terminal.wait()
    stands(simulator)


def test_keys_that_waited_while_it_was_suspended_drive_nothing(
    simulator: Simulator, terminal: TypingTerminal
) -> None:
    begin_to_drive(terminal, simulator)
    terminal.process.send_signal(signal.SIGSTOP)
    stands(simulator)  # its last setpoint has run out
    before = simulator.get("true.x_m"), simulator.get("true.y_m")
    terminal.press(b"w" * 5)
    time.sleep(0.5)
    terminal.process.send_signal(signal.SIGCONT)
    time.sleep(1.0)
    assert (simulator.get("true.x_m"), simulator.get("true.y_m")) == before
    terminal.press(b"q")
    assert terminal.wait() == 0


def test_plain_prints_lines_in_a_terminal(simulator: Simulator) -> None:
    with view(simulator, "--plain", "--seconds", "1.5") as terminal:
        assert terminal.wait() == 0
        terminal.wait_for("lost 0", 2)
        assert b"\x1b[?1049h" not in terminal.output


def test_it_follows_the_window(terminal: TypingTerminal) -> None:
    terminal.wait_for(SCREEN)
    for columns, rows in ((200, 60), (60, 20), (3, 2), (80, 24)):
        before = len(terminal.output)
        terminal.resize(columns, rows)
        wait_until(lambda before=before: len(terminal.output) > before)  # type: ignore[misc]
        time.sleep(0.5)
    terminal.press(b"q")
    assert terminal.wait() == 0


class Tmux:
    """A tmux of its own, with one window that runs a command."""

    def __init__(self, folder: Path, columns: int, rows: int, command: str) -> None:
        self._tmux = ["tmux", "-S", str(folder / "tmux"), "-f", "/dev/null"]
        size = ["-x", str(columns), "-y", str(rows)]
        self._do("new-session", "-d", "-s", "view", *size, f"{command}; sleep 60")

    def _do(self, *arguments: str) -> str:
        done = subprocess.run(
            [*self._tmux, *arguments], check=True, capture_output=True, text=True, timeout=20
        )
        return done.stdout

    def lines(self) -> list[str]:
        return self._do("capture-pane", "-p", "-t", "view").rstrip("\n").split("\n")

    def press(self, key: str) -> None:
        self._do("send-keys", "-t", "view", key)

    def close(self) -> None:
        self._do("kill-server")


@pytest.mark.skipif(shutil.which("tmux") is None, reason="needs tmux")
@pytest.mark.parametrize(
    ("columns", "rows", "colour"), [(80, 24, True), (60, 20, False), (200, 60, True)]
)
def test_all_of_it_is_on_the_screen_of_tmux(
    simulator: Simulator, tmp_path: Path, columns: int, rows: int, *, colour: bool
) -> None:
    # These two would say another size than tmux's.
    environment = ["env", "-u", "COLUMNS", "-u", "LINES", "LC_ALL=C.UTF-8"]
    command = [*environment, *([] if colour else ["NO_COLOR=1"])]
    command += [*PROGRAM, "monitor", simulator.port]
    tmux = Tmux(tmp_path, columns, rows, shlex.join(command))
    try:
        wait_until(lambda: any("Hz" in line and "loss" in line for line in tmux.lines()))
        wait_until(lambda: any("⣀" in line for line in tmux.lines()))
        text = "\n".join(tmux.lines())
        for part in ("IDLE: Stopped", "LEFT", "RIGHT", "last 20 s", "clock ±", "supply", "q quit"):
            assert part in text
        assert len(tmux.lines()) == rows
        tmux.press("q")
        wait_until(lambda: "q quit" not in "\n".join(tmux.lines()))
    finally:
        tmux.close()
