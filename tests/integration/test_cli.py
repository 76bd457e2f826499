"""The command, as a person and a script use it, against the simulated robot.

What opens a link is tested on a bad line; the demonstration brings its own robot.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import wheelwire
from support.cases import each
from support.command import PROGRAM, TIMEOUT_S, check_error, output, run, run_json
from support.processes import children, interruptible, talking
from support.simulator_on_line import GOOD, simulator_on
from support.waiting import undisturbed, wait_until
from wheelwire import errors
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.demo import scenario
from wheelwire_protocol.codes import ResetReason


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with simulator_on("noisy") as simulator:
        yield simulator


@pytest.fixture(scope="module")
def quiet() -> Iterator[Simulator]:
    """On a good line: for what no line changes."""
    with simulator_on(GOOD) as simulator:
        yield simulator


def wait_for_rest(simulator: Simulator) -> None:
    """Until the robot itself takes its wheels for at rest, and lets all parameters be set."""
    with wheelwire.connect(simulator.port) as robot:
        wait_until(lambda: not (sample := robot.read()).left_mps and not sample.right_mps)


def test_info_says_when_a_core_dump_is_there(simulator: Simulator) -> None:
    assert run_json("info", simulator.port)["core_dump"] is False
    simulator.set("core_dump", 1)
    simulator.reset(ResetReason.PANIC)
    reported = run_json("info", simulator.port)
    assert reported["core_dump"] is True
    assert "CORE_DUMP" in reported["link"]["device"]["capabilities"]
    assert "of a crash, in flash" in output("info", simulator.port)
    simulator.set("core_dump", 0)
    simulator.reset()
    assert "of a crash" not in output("info", simulator.port)


def test_an_estop_holds_until_it_is_cleared(simulator: Simulator) -> None:
    assert "wheelwire clear" in output("estop", simulator.port)
    line = check_error(run("drive", simulator.port, "--linear", "0.2"), errors.DeviceRefused)
    assert "Emergency stop is latched" in line
    assert f"`wheelwire clear {simulator.port}` ends it" in line
    assert "estop_input_enabled 0 --save" in line
    assert f"`wheelwire clear {simulator.port}` ends it" in output(
        "info", simulator.port, COLUMNS="200"
    )
    reported = {"ended": "ESTOPPED", "state": "IDLE", "faults": []}
    simulator.set("estop_open", 1)
    line = check_error(run("clear", simulator.port), errors.DeviceRefused)
    assert "connect its pin to ground" in line
    simulator.set("estop_open", 0)
    assert run_json("clear", simulator.port) == reported
    assert output("clear", simulator.port) == "nothing was latched\n"
    assert run_json("info", simulator.port)["state"] == "IDLE"


def test_a_fault_that_ends_a_drive_is_named_also_when_an_estop_hid_it(quiet: Simulator) -> None:
    quiet.set("left.encoder_dead", 1)
    try:
        result = run("drive", quiet.port, "--linear", "0.3", "--seconds", "30")
    finally:
        quiet.set("left.encoder_dead", 0)
    assert "LEFT_NOT_COUNTING: The left wheel" in check_error(result, errors.DeviceRefused)
    run("estop", quiet.port)
    text = output("clear", quiet.port)
    assert text.startswith("ESTOPPED cleared\nFAULT remains. LEFT_NOT_COUNTING: ")
    assert f"`wheelwire clear {quiet.port}` again" in text
    assert output("clear", quiet.port) == "FAULT cleared\n"
    wait_for_rest(quiet)


def test_a_drive_beyond_the_limit_says_so_and_how_it_came_to_a_stop(quiet: Simulator) -> None:
    text = output("drive", quiet.port, "--linear", "5", "--seconds", "0.3")
    assert "limited to 0.4 m/s and 0 rad/s: no wheel may exceed 0.4 m/s" in text
    text = output("drive", quiet.port, "--linear", "0.2", "--seconds", "1")
    assert "no wheel" not in text
    assert "m of it while stopping" in text
    reported = run_json("drive", quiet.port, "--linear", "-5", "--seconds", "0.3")
    assert reported["linear_mps"] == pytest.approx(-0.4)
    assert 0 < reported["rolled_out_m"] < -reported["x_m"]


def test_parameters_are_set_saved_and_reset(quiet: Simulator) -> None:
    port = quiet.port
    text = output("params", "set", port, "integral_gain", "12")
    assert text == "integral_gain = 12, until the next reset; --save keeps it\n"
    text = output("params", "set", port, "proportional_gain", "1.5", "--save")
    assert text == "proportional_gain = 1.5, saved\n"
    quiet.reset()
    assert output("params", "get", port, "integral_gain") == "16\n"
    assert run_json("params", "get", port, "proportional_gain") == {"proportional_gain": 1.5}
    run("params", "set", port, "path_gain", "1")
    assert output("params", "save", port) == (
        "all values saved; different from their defaults: proportional_gain = 1.5, path_gain = 1\n"
    )
    saved = run_json("params", "save", port, "path_gain", "max_duty")
    assert saved == {"saved": {"path_gain": 1, "max_duty": 1}}
    check_error(run("params", "save", port, "max_duty", "max_dooty"), errors.UnknownParameter)
    text = output("params", "set", port, "pwm_frequency_hz", "18000")
    assert "no effect: it acts only from the next start, and is lost then; use --save" in text
    assert f"`wheelwire restart {port}`" in text
    assert run_json("params", "reset", port, "--yes")["reset"] is True
    assert run_json("params", "get", port, "proportional_gain") == {"proportional_gain": 1.2}


def test_a_narrow_terminal_gets_the_parameters_without_a_table(quiet: Simulator) -> None:
    lines = output("params", "list", quiet.port, COLUMNS="80").splitlines()
    assert lines[:2] == [
        "wheel_radius = 0.033 m, 0.005..1",
        "    Radius of the driven wheels." + " " * 48,
    ]
    assert max(map(len, lines)) <= 80


# --- the address -------------------------------------------------------------------------------


@pytest.fixture
def file(quiet: Simulator, tmp_path: Path) -> str:
    """A robot's file for the simulated robot; it changes one parameter."""
    file = tmp_path / "robot.yaml"
    file.write_text(
        f"driver: serial\nserial: {{port: {quiet.port}}}\nparameters: {{max_duty: 0.5}}\n"
    )
    return str(file)


def test_a_robots_file_is_an_address(quiet: Simulator, file: str) -> None:
    reported = run_json("drive", file, "--linear", "0.2", "--seconds", "0.5")
    assert reported["x_m"] > 0.05
    assert run_json("params", "get", quiet.port, "max_duty") == {"max_duty": 0.5}
    assert run_json("params", "set", file, "path_gain", "1") == {"path_gain": 1, "saved": False}
    check_error(run("params", "set", file, "max_duty", "1"), errors.InvalidArgument)
    assert f"`wheelwire clear {file}` ends it" in output("estop", file)
    assert run_json("info", file)["state"] == "ESTOPPED"
    assert run_json("clear", file)["state"] == "IDLE"
    run("params", "reset", quiet.port, "--yes")


def test_what_looks_and_stops_by_a_robots_file_leaves_the_parameters_alone(
    quiet: Simulator, file: str, tmp_path: Path
) -> None:
    """The file's value is not what the robot has: what reads shows the robot's, and leaves it."""
    run("params", "reset", quiet.port, "--yes")
    for command in ("info", "estop", "clear", "monitor --seconds 0.1"):
        word, *options = command.split()
        assert run(word, file, *options).returncode == 0
    exported = tmp_path / "exported.yaml"
    exported.write_text(output("params", "export", file))
    assert "max_duty: 1 duty" in exported.read_text()
    assert run_json("params", "get", file, "max_duty") == {"max_duty": 1}
    listed = {p["name"]: p["value"] for p in run_json("params", "list", file)}
    assert listed["max_duty"] == 1
    assert run("params", "diff", file, str(exported)).returncode == 0
    assert run_json("params", "get", quiet.port, "max_duty") == {"max_duty": 1}


def test_mock_is_an_address() -> None:
    assert run_json("info", "mock")["link"]["device"]["board"] == "SIMULATED"
    assert output("monitor", "mock", "--seconds", "0.1").count("IDLE") > 0
    assert run_json("drive", "mock", "--linear", "0.2", "--seconds", "0.5")["x_m"] > 0.05
    assert run_json("estop", "mock") == {"latched": None}
    assert "stopped, but not latched" in output("estop", "mock")
    assert output("clear", "mock") == "nothing was latched\n"
    assert output("params", "get", "mock", "wheel_radius") == "0.033\n"
    text = output("params", "set", "mock", "wheel_radius", "0.04")
    assert text == "wheel_radius = 0.04, for this command only: the robot's process ended with it\n"
    assert len(run_json("params", "list", "mock")) > 20
    assert run_json("params", "reset", "mock", "--yes")["reset"] is True
    assert run_json("restart", "mock")["state"] == "IDLE"


def test_the_environment_names_the_robot(quiet: Simulator) -> None:
    robot = {"WHEELWIRE_ROBOT": quiet.port}
    result = run("drive", "--linear", "0.2", "--seconds", "0.3", **robot)
    assert result.returncode == 0
    assert result.stderr == f"wheelwire: using {quiet.port}, named by WHEELWIRE_ROBOT\n"
    assert output("params", "set", "path_gain", "1", **robot).startswith("path_gain = 1, until")
    assert output("params", "get", "path_gain", **robot) == "1\n"
    assert output("params", "save", "path_gain", **robot) == "saved: path_gain = 1\n"
    assert run("params", "reset", "--yes", **robot).returncode == 0


@each(
    ("arguments", "error", "hint"),
    [
        ("drive {port} --linear nan", errors.InvalidCommand, "finite"),
        ("drive {port} --angular inf", errors.InvalidCommand, "finite"),
        ("drive {port}", errors.InvalidCommand, "use --linear, --angular or both"),
        (
            "params set {port} wheel_radius 33",
            errors.ParameterOutOfRange,
            "wheel_radius = 33.0 is out of range: it must be at most 1 m (0.033 is 33 mm)",
        ),
        ("params set {port} integral_gain -1", errors.ParameterOutOfRange, "least 0"),
        (
            "params set {port} estop_input_enabled true",
            errors.ParameterOutOfRange,
            "it must be 0 (off) or 1 (on)",
        ),
        ("params set {port} max_duty much", errors.ParameterOutOfRange, "a finite"),
        ("params set {port} stop_mode 1.5", errors.ParameterOutOfRange, "whole"),
        ("params get {port} wheel_radus", errors.UnknownParameter, "wheel_radius"),
        ("info /dev/no-such-port", errors.PortUnavailable, "wheelwire ports"),
        ("info /dev/null", errors.PortUnavailable, "wheelwire ports"),
        ("info socket://127.0.0.1:1", errors.PortUnavailable, "nobody listens"),
    ],
)
def test_errors_are_one_line_that_helps(
    simulator: Simulator, arguments: str, error: type[errors.WheelwireError], hint: str
) -> None:
    result = run(*arguments.format(port=simulator.port).split())
    assert hint in check_error(result, error)
    assert simulator.get("drive_on") == 0


@contextmanager
def sim(link: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A simulator in a process of its own, and the first line that it printed."""
    with talking(*PROGRAM, "sim", "--link", link, *options) as told:
        yield told
        told[0].terminate()
        told[0].communicate(timeout=TIMEOUT_S)


def test_the_link_of_a_sim_is_left_alone_until_that_is_killed(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    with sim(link) as (process, _):
        target = link.readlink()
        result = run("sim", "--link", str(link), "--faults", "noisy")
        assert (result.returncode, result.stdout) == (1, "")
        assert f"{link} is the port of another simulator (process " in result.stderr
        assert "give another --link" in result.stderr
        assert link.readlink() == target
        assert run("info", str(link)).returncode == 0
        os.kill(int(link.with_name("robot.lock").read_text()), signal.SIGKILL)
        assert process.wait(TIMEOUT_S) == errors.WheelwireError.exit_code
    assert link.is_symlink()
    with sim(link, "--faults", "noisy"):
        assert run("info", str(link)).returncode == 0
    assert list(tmp_path.iterdir()) == []


@each("mass", ["-- --set=mass_kg=3", "--set mass_kg=3"])
def test_sim_takes_a_plant_and_what_is_set_beside_it(tmp_path: Path, mass: str) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text("variables: {wheels_free: 1, mass_kg: 2, motors_swapped: 1}")
    asked = "".join(f"get {name}\n" for name in ("mass_kg", "wheels_free", "motors_swapped"))
    options = ["--json", "--link", str(tmp_path / "robot"), "--plant", str(mine)]
    result = subprocess.run(
        [*PROGRAM, "sim", *options, *mass.split()],
        input=f"{asked}quit\n",
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=True,
    )
    answers = [json.loads(line) for line in result.stdout.splitlines()[1:]]
    assert [answer.get("value") for answer in answers[:3]] == [3.0, 1.0, 1.0]


# --- the demonstration -------------------------------------------------------------------------


def test_demo_measures_what_it_claims(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Its setpoints live through what a busy computer does to a process.
    monkeypatch.setattr(scenario, "TTL_S", 1.0)

    def demo() -> dict[str, float]:
        return dict(run_json("demo", "--output", str(tmp_path)))

    report = undisturbed(demo, lambda one: one["frames_lost"] == one["setpoints_expired"] == 0)
    assert report["setpoints_expired"] == 0
    assert (tmp_path / "trajectory.png").stat().st_size > 10_000
    assert report["distance_m"] == pytest.approx(5.3, abs=0.3)
    assert report["position_error_m"] < 0.02
    assert report["frames_lost"] == 0
    assert 0 <= report["drive_removed_after_deadline_us"] <= 1000
    assert report["stopping_distance_m"] > 0.01


def test_demo_interrupted_leaves_nothing_behind(tmp_path: Path) -> None:
    demo = subprocess.Popen(
        [*PROGRAM, "demo", "--output", str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,
    )
    assert demo.stdout
    while "DRIVING" not in demo.stdout.readline():
        assert demo.poll() is None
    (simulator,) = children(demo.pid)
    demo.send_signal(signal.SIGINT)
    demo.communicate(timeout=TIMEOUT_S)
    assert demo.returncode == 130
    end = time.monotonic() + TIMEOUT_S
    while Path(f"/proc/{simulator}").exists():
        assert time.monotonic() < end
        time.sleep(0.01)
