"""The examples do what they say, on a simulated robot."""

from __future__ import annotations

import csv
import math
import os
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.command import TIMEOUT_S
from support.processes import interruptible
from support.waiting import wait_until
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import SupervisorState

PRESS_S = 5.0
MOST_PRESSES = 10
EXAMPLES = Path(__file__).parents[2] / "examples"


def start(name: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-u", str(EXAMPLES / name), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,
    )


@contextmanager
def ending(process: subprocess.Popen[str]) -> Iterator[None]:
    """Kill the process at the end of the block, if it still runs then."""
    try:
        yield
    finally:
        process.kill()
        process.wait()


def end(process: subprocess.Popen[str], typed: str = "") -> str:
    output, errors = process.communicate(typed, timeout=TIMEOUT_S)
    assert process.returncode == 0, errors
    return output


def wait_while_running(process: subprocess.Popen[str], condition: Callable[[], bool]) -> None:
    wait_until(lambda: condition() or process.poll() is not None, TIMEOUT_S)
    if process.poll() is not None:
        pytest.fail(process.communicate()[1])


def test_the_square_closes(simulator: Simulator) -> None:
    output = end(start("square.py", simulator.port, "--side", "0.4"))
    assert [line.split(":")[0] for line in output.splitlines()] == [
        f"corner {number}" for number in (1, 2, 3, 4)
    ]
    assert simulator.get("true.distance_m") > 1.5
    assert math.hypot(simulator.get("true.x_m"), simulator.get("true.y_m")) < 0.03
    assert simulator.get("true.heading_rad") == pytest.approx(2 * math.pi, abs=0.05)


def test_the_log_has_a_row_for_each_sample(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    with Simulator() as simulator:
        output = end(start("log_csv.py", str(file), simulator.port, "--seconds", "1"))
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    assert output.startswith(f"{len(rows)} samples in {file}")
    assert len(rows) > 20
    times = [float(row["device_time_s"]) for row in rows]
    assert times == sorted(set(times))
    missing = round((times[-1] - times[0]) / 0.01) + 1 - len(rows)
    assert missing <= int(output.split()[-2])  # every sample is there, or counted
    assert {row["state"] for row in rows} == {"IDLE"}


def test_a_task_drives_while_another_one_watches(simulator: Simulator) -> None:
    output = end(start("asyncio_drive.py", simulator.port, "--seconds", "2"))
    states = [line.split()[-1] for line in output.splitlines()]
    assert "DRIVING" in states
    assert states[-1] == "done"
    assert simulator.get("state") == SupervisorState.IDLE
    assert simulator.get("true.distance_m") > 0.2


def test_the_e_stop_is_lived_through(simulator: Simulator) -> None:
    process = start("estop.py", simulator.port, "--seconds", "2")
    wait_while_running(process, lambda: simulator.get("true.distance_m") > 0.1)
    simulator.set("estop_open", 1)
    wait_while_running(process, lambda: simulator.get("stands_still") == 1)
    stopped_m = simulator.get("true.distance_m")
    assert process.stdin
    process.stdin.write("\n")  # the contact is still open
    process.stdin.flush()
    assert process.stdout
    line = process.stdout.readline()
    assert "release the button" in line
    assert "not yet: the device refused" in line
    simulator.set("estop_open", 0)
    output = end(process, "\n")
    # The prompt before it has no end of line, and may have come with the line above.
    assert output.endswith("cleared; driving again\ndone\n")
    assert simulator.get("true.distance_m") > stopped_m + 0.05
    wait_until(lambda: simulator.get("stands_still"), TIMEOUT_S)


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_an_unreachable_robot_gives_one_line(name: str, tmp_path: Path) -> None:
    before = [str(tmp_path / "run.csv")] if name == "log_csv.py" else []
    process = start(name, *before, "/dev/no-such-port")
    _, errors = process.communicate("", timeout=TIMEOUT_S)
    assert process.returncode == 1
    assert errors.startswith("cannot open /dev/no-such-port")
    assert errors.count("\n") == 1


def test_ctrl_c_stops_and_is_one_line(simulator: Simulator) -> None:
    process = start("square.py", simulator.port, "--side", "5")
    with ending(process):
        wait_while_running(process, lambda: simulator.get("true.x_m") > 0.02)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=TIMEOUT_S)
        assert errors == "interrupted; the robot was stopped\n"
        assert simulator.get("drive_on") == 0


def test_keys_drive_and_stop_and_the_terminal_is_as_it_was() -> None:
    keyboard, terminal = os.openpty()
    before = termios.tcgetattr(terminal)
    with Simulator() as simulator:
        process = subprocess.Popen(
            [sys.executable, "-u", str(EXAMPLES / "teleop.py"), simulator.port],
            stdin=terminal,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        with ending(process):
            assert process.stdout
            while "IDLE" not in process.stdout.read(20):
                assert process.poll() is None
            reader = threading.Thread(target=process.stdout.read)
            reader.start()
            presses = 0
            while simulator.get("true.x_m") < 0.03:
                # On a busy computer a setpoint may come too late, and move nothing.
                presses += 1
                assert presses < MOST_PRESSES
                os.write(keyboard, b"i")
                until = time.monotonic() + PRESS_S
                while simulator.get("true.x_m") < 0.03 and time.monotonic() < until:
                    time.sleep(0.01)
                # One key is one setpoint.
                wait_until(lambda: simulator.get("stands_still"), TIMEOUT_S)
            assert simulator.get("true.x_m") < 0.3 * presses
            os.write(keyboard, b"ei")
            wait_until(lambda: simulator.get("state") == SupervisorState.ESTOPPED, TIMEOUT_S)
            os.write(keyboard, b"c")
            # A zero setpoint follows the clear, so it is IDLE only for a moment.
            wait_until(lambda: simulator.get("state") != SupervisorState.ESTOPPED, TIMEOUT_S)
            os.write(keyboard, b"q")
            assert process.wait(TIMEOUT_S) == 0
            reader.join()
            process.stdout.close()
    assert termios.tcgetattr(terminal) == before
    os.close(terminal)
    os.close(keyboard)
