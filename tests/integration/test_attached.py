"""Commands beside a program that holds the robot's port: they look, stop and e-stop."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.attached import wait_for_holder
from support.cases import each
from support.command import PROGRAM, TIMEOUT_S, check_error, run, run_process
from support.processes import talking
from support.range_board import simulator_on_board
from support.simulator_on_line import GOOD, simulator_on
from support.waiting import undisturbed, wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.sharing_folder import DIRECTORY_VARIABLE
from wheelwire.log.reader import is_complete, messages, metadata
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import SupervisorState

HOLDING = """
import sys, time, wheelwire
with wheelwire.open_driver("serial", port=sys.argv[1]) as robot:
    print("open", flush=True)
    while True:
        robot.set_velocity(0.1, 0.0, ttl=0.3)
        time.sleep(0.05)
"""
OURS = f"process {os.getpid()}"


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with simulator_on("noisy") as simulator:
        yield simulator


@pytest.fixture
def robot(simulator: Simulator) -> Iterator[SerialDriver]:
    """Held by this process."""
    with SerialDriver(simulator.port) as robot:
        wait_for_holder(simulator.port)
        yield robot


@contextmanager
def another_holder(port: str) -> Iterator[subprocess.Popen[str]]:
    """Another process, which drives."""
    with talking(sys.executable, "-c", HOLDING, port) as (holder, line):
        assert line == "open\n"
        wait_for_holder(port)
        yield holder


def attached(*arguments: str, **environment: str) -> str:
    """What a command prints that is attached, and says so in one line."""
    result = run(*arguments, **environment)
    assert result.returncode == 0, result.stderr
    (said,) = result.stderr.splitlines()
    assert "attached to the link of" in said
    assert OURS in said
    return result.stdout


def refused(*arguments: str, **environment: str) -> str:
    """The error of a command for which the port is in use."""
    return check_error(run(*arguments, **environment), errors.PortUnavailable)


def refused_process(*arguments: str, **environment: str) -> str:
    """As `refused`, of a command in a process of its own: for it another program holds the port."""
    return check_error(
        run_process(*arguments, timeout_s=TIMEOUT_S, **environment), errors.PortUnavailable
    )


def test_commands_that_only_look_attach(robot: SerialDriver, simulator: Simulator) -> None:
    robot.parameters.set("max_duty", 0.5)
    port = simulator.port
    result = run("info", port, "--json")
    assert OURS in json.loads(result.stderr)["note"]
    info = json.loads(result.stdout)
    assert info["link"]["port"] == port
    assert info["link"]["device"]["board_id"] == robot.info.device.board_id
    assert info["device_counters"]["frames_received"] > 0
    assert attached("params", "get", port, "max_duty") == "0.5\n"
    values = {
        one["name"]: one["value"] for one in json.loads(attached("params", "list", port, "--json"))
    }
    assert values["max_duty"] == 0.5
    assert "max_duty: 0.5 duty" in attached("params", "export", port)
    assert "name: L298N, simulated" in attached("board", "read", port)
    assert attached("monitor", port, "--seconds", "1.5").count("IDLE") == 2
    assert robot.is_open
    assert robot.sessions == 1


def test_an_estop_stops_the_program_that_drives(robot: SerialDriver, simulator: Simulator) -> None:
    robot.set_velocity(0.1, 0.0, ttl=1.0)
    assert "stopped and latched; once" in attached("estop", simulator.port)
    wait_until(lambda: robot.read().state is SupervisorState.ESTOPPED)
    with pytest.raises(errors.DeviceRefused):
        robot.set_velocity(0.1, 0.0, ttl=1.0)
    robot.clear_estop()


@each(
    "command",
    [
        "drive {} --linear 0.1",
        "clear {}",
        "params set {} max_duty 0.5",
        "params save {}",
        "params reset {} --yes",
        "board write {} l298n",
        "board confirm {} --yes",
        "restart {}",
    ],
)
def test_driving_setting_and_clearing_need_the_port(
    robot: SerialDriver, simulator: Simulator, command: str
) -> None:
    def refusal() -> tuple[int, str, int]:
        before = robot.sessions
        return before, refused(*command.format(simulator.port).split()), robot.sessions

    robot.estop()
    # A line that a busy computer holds up for long is a new session, too.
    before, line, after = undisturbed(refusal, lambda found: found[0] == found[2])
    assert "this program has it open already" in line
    assert robot.read().state is SupervisorState.ESTOPPED
    assert robot.parameters["max_duty"] == 1
    assert after == before


def test_a_stop_that_reaches_nobody_says_so(tmp_path: Path) -> None:
    """The holder offers nothing; or it is another user's, who has a folder of his own."""
    with simulator_on(GOOD) as simulator:
        with SerialDriver(simulator.port, tap=False) as robot:
            unoffered = refused_process("estop", simulator.port)
            assert robot.read().state is SupervisorState.IDLE
        with SerialDriver(simulator.port):
            wait_for_holder(simulator.port)
            elsewhere = {DIRECTORY_VARIABLE: str(tmp_path / "another")}
            unseen = refused_process("stop", simulator.port, **elsewhere)
            assert refused("info", simulator.port, **elsewhere)
            attached("stop", simulator.port)
    for line in (unoffered, unseen):
        assert OURS in line
        assert line.partition(" (more: ")[0].endswith("Nothing was sent")


def test_a_monitor_and_a_recording_end_with_the_program_beside_which_they_are(
    tmp_path: Path,
) -> None:
    path = tmp_path / "day.mcap"
    with simulator_on_board() as simulator:
        # A Simulator is at a name of its own: the program uses that, and these the device's.
        port = str(Path(simulator.port).resolve())
        with (
            another_holder(simulator.port) as holder,
            talking(*PROGRAM, "monitor", port, "--json", stderr=subprocess.PIPE) as (monitor, line),
            subprocess.Popen(
                [*PROGRAM, "log", "record", port, str(path)],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            ) as recording,
        ):
            assert json.loads(line)["state"] == "DRIVING"
            wait_until(path.exists)
            time.sleep(3.0)
            assert json.loads(run("info", port, "--json").stdout)["state"] == "DRIVING"
            assert simulator.get("true.left_mps") > 0.05
            holder.send_signal(signal.SIGKILL)
            _, said = monitor.communicate(timeout=TIMEOUT_S)
            wrote, notes = recording.communicate(timeout=TIMEOUT_S)
        # It left its socket behind, but the port is free: the next program opens it.
        assert list(Path(os.environ[DIRECTORY_VARIABLE]).glob("*.tap"))
        result = run("monitor", simulator.port, "--seconds", "0.3")
        assert (result.returncode, result.stderr) == (0, "")
    assert monitor.returncode == errors.LinkClosed.exit_code
    assert f"process {holder.pid}, which held {port}, has ended" in said
    assert recording.returncode == 0, notes
    assert f"wrote {path}" in wrote
    assert notes.startswith("wheelwire: attached to the link of python")
    assert "has ended, and so does the recording" in notes
    found = [topic for topic, _, _ in messages(path)]
    assert found.count("/imu/data_raw") > 20
    assert found.count("/odom") > 50
    setpoints = run("log", "decode", str(path), "--message", "SetWheelVelocity").stdout
    assert len(setpoints.splitlines()) > 30
    assert metadata(path)["board_id"] != ""
    assert is_complete(path)
