"""The command, as a person and a script use it, against the simulated robot.

What opens a link is tested on a bad line; the demonstration brings its own robot.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
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
from support.usb_ports import plug_in
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


def test_info(simulator: Simulator) -> None:
    text = output("info", simulator.port)
    assert "SIMULATED" in text
    assert "IDLE" in text
    reported = run_json("info", simulator.port)
    assert reported["link"]["port"] == simulator.port
    assert reported["faults"] == []
    assert reported["device_counters"]["frames_received"] > 0


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


def test_drive_drives_and_stops(simulator: Simulator) -> None:
    before = simulator.get("true.distance_m")
    pose = run_json("drive", simulator.port, "--linear", "0.2", "--seconds", "1")
    driven = simulator.get("true.distance_m") - before
    assert pose["x_m"] == pytest.approx(driven, abs=0.01)
    assert 0.1 < driven < 0.3
    assert simulator.get("stands_still")


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
    assert run_json("clear", simulator.port) == reported
    assert output("clear", simulator.port) == "nothing was latched\n"
    assert run_json("info", simulator.port)["state"] == "IDLE"


def test_a_fault_that_ends_a_drive_is_named(simulator: Simulator) -> None:
    simulator.set("left.encoder_dead", 1)
    try:
        result = run("drive", simulator.port, "--linear", "0.3", "--seconds", "30")
    finally:
        simulator.set("left.encoder_dead", 0)
    assert "LEFT_NOT_COUNTING: The left wheel" in check_error(result, errors.DeviceRefused)
    assert output("clear", simulator.port) == "FAULT cleared\n"
    wait_for_rest(simulator)


def test_a_fault_that_an_estop_hid_is_named_when_the_estop_ends(quiet: Simulator) -> None:
    quiet.set("left.encoder_dead", 1)
    try:
        run("drive", quiet.port, "--linear", "0.3", "--seconds", "30")
    finally:
        quiet.set("left.encoder_dead", 0)
    run("estop", quiet.port)
    text = output("clear", quiet.port)
    assert text.startswith("ESTOPPED cleared\nFAULT remains. LEFT_NOT_COUNTING: ")
    assert f"`wheelwire clear {quiet.port}` again" in text
    assert output("clear", quiet.port) == "FAULT cleared\n"


def test_an_open_contact_says_what_to_do_where_none_is_fitted(quiet: Simulator) -> None:
    quiet.set("estop_open", 1)
    try:
        line = check_error(run("clear", quiet.port), errors.DeviceRefused)
    finally:
        quiet.set("estop_open", 0)
        run("clear", quiet.port)
    assert "connect its pin to ground" in line


def test_a_drive_beyond_the_limit_says_so_and_how_it_came_to_a_stop(quiet: Simulator) -> None:
    text = output("drive", quiet.port, "--linear", "5", "--seconds", "0.3")
    assert "limited to 0.4 m/s and 0 rad/s: no wheel may exceed 0.4 m/s" in text
    text = output("drive", quiet.port, "--linear", "0.2", "--seconds", "1")
    assert "no wheel" not in text
    assert "m of it while stopping" in text
    reported = run_json("drive", quiet.port, "--linear", "-5", "--seconds", "0.3")
    assert reported["linear_mps"] == pytest.approx(-0.4)
    assert 0 < reported["rolled_out_m"] < -reported["x_m"]


def test_monitor_lines_are_json(simulator: Simulator) -> None:
    lines = output("monitor", simulator.port, "--seconds", "0.3", "--json").splitlines()
    times = [json.loads(line)["t_us"] for line in lines]
    assert len(times) > 5
    assert times == sorted(set(times))


def test_parameters_are_listed_set_saved_and_reset(simulator: Simulator) -> None:
    names = [p["name"] for p in run_json("params", "list", simulator.port)]
    assert "wheel_radius" in names
    assert run_json("params", "set", simulator.port, "wheel_radius", "0.04", "--save") == {
        "wheel_radius": 0.04,
        "saved": True,
    }
    simulator.reset()
    assert output("params", "get", simulator.port, "wheel_radius") == "0.04\n"
    assert run_json("params", "reset", simulator.port, "--yes")["reset"] is True
    assert run_json("params", "get", simulator.port, "wheel_radius") == {"wheel_radius": 0.033}


def test_a_narrow_terminal_gets_the_parameters_without_a_table(quiet: Simulator) -> None:
    lines = output("params", "list", quiet.port, COLUMNS="80").splitlines()
    assert lines[:2] == [
        "wheel_radius = 0.033 m, 0.005..1",
        "    Radius of the driven wheels." + " " * 48,
    ]
    assert max(map(len, lines)) <= 80


def test_only_the_value_that_is_named_is_saved(quiet: Simulator) -> None:
    port = quiet.port
    text = output("params", "set", port, "integral_gain", "12")
    assert text == "integral_gain = 12, until the next reset; --save keeps it\n"
    text = output("params", "set", port, "proportional_gain", "1.5", "--save")
    assert text == "proportional_gain = 1.5, saved\n"
    quiet.reset()
    assert output("params", "get", port, "integral_gain") == "16\n"
    assert output("params", "get", port, "proportional_gain") == "1.5\n"
    run("params", "set", port, "integral_gain", "12")
    run("params", "set", port, "path_gain", "1")
    assert output("params", "save", port, "path_gain") == "saved: path_gain = 1\n"
    assert output("params", "save", port) == (
        "all values saved; different from their defaults: "
        "proportional_gain = 1.5, integral_gain = 12, path_gain = 1\n"
    )
    saved = run_json("params", "save", port, "path_gain", "max_duty")
    assert saved == {"saved": {"path_gain": 1, "max_duty": 1}}
    check_error(run("params", "save", port, "max_duty", "max_dooty"), errors.UnknownParameter)
    run("params", "reset", port, "--yes")


def test_a_value_that_acts_after_a_reset_says_so(quiet: Simulator) -> None:
    text = output("params", "set", quiet.port, "pwm_frequency_hz", "18000")
    assert "no effect: it acts only from the next start, and is lost then; use --save" in text
    assert f"`wheelwire restart {quiet.port}`" in text
    text = output("params", "set", quiet.port, "pwm_frequency_hz", "18000", "--save")
    assert "pwm_frequency_hz = 18000, saved; takes effect at the next start" in text
    assert f"`wheelwire restart {quiet.port}`" in text
    run("params", "reset", quiet.port, "--yes")


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


def test_looking_and_stopping_leave_the_parameters_alone(quiet: Simulator, file: str) -> None:
    for command in ("info", "estop", "clear"):
        assert run(command, file).returncode == 0
    assert run("monitor", file, "--seconds", "0.1").returncode == 0
    assert run_json("params", "get", quiet.port, "max_duty") == {"max_duty": 1}


def test_reading_parameters_by_a_robots_file_writes_none(
    quiet: Simulator, file: str, tmp_path: Path
) -> None:
    """The file's value is not what the robot has: what reads shows the robot's, and leaves it."""
    run("params", "reset", quiet.port, "--yes")
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


def test_the_environment_names_the_robot(quiet: Simulator) -> None:
    robot = {"WHEELWIRE_ROBOT": quiet.port}
    result = run("drive", "--linear", "0.2", "--seconds", "0.3", **robot)
    assert result.returncode == 0
    assert result.stderr == f"wheelwire: using {quiet.port}, named by WHEELWIRE_ROBOT\n"
    assert output("params", "set", "path_gain", "1", **robot).startswith("path_gain = 1, until")
    assert output("params", "get", "path_gain", **robot) == "1\n"
    assert output("params", "save", "path_gain", **robot) == "saved: path_gain = 1\n"
    assert run("params", "reset", "--yes", **robot).returncode == 0


def test_an_estop_of_the_only_candidate_asks_nothing(
    quiet: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    plug_in(monkeypatch, quiet.port)
    result = run("estop", WHEELWIRE_ROBOT="")
    assert result.returncode == 0, result.stderr
    assert f"{quiet.port} is the only candidate" in result.stderr
    assert run_json("info", quiet.port)["state"] == "ESTOPPED"
    assert output("clear", "--yes", WHEELWIRE_ROBOT="") == "ESTOPPED cleared\n"


def test_ports_is_json_without_a_robot() -> None:
    assert isinstance(run_json("ports"), list)


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


def test_sim_is_there_until_it_is_ended(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    with sim(link, "--faults", "noisy") as (process, line):
        assert (
            line
            == f"A simulated robot is running at {link}; Ctrl-C stops it. In another terminal:\n"
        )
        assert run("info", str(link)).returncode == 0
    assert process.returncode == 0
    assert list(tmp_path.iterdir()) == []
    with sim(link, "--json") as (_, line):
        assert json.loads(line)["event"] == "ready"


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


def test_sim_on_a_line_that_cannot_be(tmp_path: Path) -> None:
    profile = tmp_path / "mine.yaml"
    profile.write_text("to_host: {loss: 3}")
    line = check_error(run("sim", "--faults", str(profile)), errors.ConfigurationError)
    assert str(profile) in line
    assert "0 to 1" in line


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


def test_sim_refuses_an_invalid_plant(tmp_path: Path) -> None:
    line = check_error(run("sim", "--plant", "nothing"), errors.ConfigurationError)
    assert "jgb37-520" in line
    mine = tmp_path / "mine.yaml"
    mine.write_text("variables: {colour: 1}")
    result = run("sim", "--link", str(tmp_path / "robot"), "--plant", str(mine))
    assert result.returncode != 0
    assert "colour" in result.stderr


# --- the demonstration -------------------------------------------------------------------------


SHORT_PROGRAM = """
import runpy
from wheelwire.tools.demo import scenario
scenario.DURATION_S = 1.0
runpy.run_module("wheelwire", run_name="__main__")
"""
"""The command, with a demonstration that drives only the beginning of its figure."""


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


def test_demo_shows_what_it_measured_though_the_picture_cannot_be_written(tmp_path: Path) -> None:
    """The disk is full by the end: no file may grow beyond 1000 bytes."""
    result = subprocess.run(
        # -B: Python would leave half of a compiled module, and read it next time.
        [sys.executable, "-B", "-c", SHORT_PROGRAM, "demo", "--output", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)),
    )
    assert result.returncode == errors.OutputFailed.exit_code
    assert "distance driven" in result.stdout
    assert "trajectory.png: File too large" in result.stderr
    assert "Traceback" not in result.stderr


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
