"""`wheelwire setup` in real time, on a pseudo-terminal, and of a robot of its own."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import mkdtemp

import pytest

from support.command import check_error, run, run_json
from support.typing_terminal import TypingTerminal
from support.waiting import wait_until
from wheelwire import errors, open_driver
from wheelwire.board import ImuSensor
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.plant import load_plant
from wheelwire.tools.setup.problems import DEFECTS
from wheelwire.tools.setup.setup import CHANGED
from wheelwire_protocol.board import ConfigurationState
from wheelwire_protocol.sensors import Axis

WRONG = {"encoders_swapped": 1, "right.motor_reversed": 1, "left.encoder_reversed": 1}
SETTINGS = {**load_plant("tt-1-48").settings, "wheels_free": 1, **WRONG}
ANSWERS = """
raised: yes
first: left forward
second: backward
counts_per_revolution: tt-1-48
wheel_radius: 0.0325
wheel_separation: 0.14
save: yes
"""
SETUP_S = 280.0
"""Limit of a whole set-up in real time, which takes some 90 s."""
FOUND = {
    "motors_swapped": 0,
    "encoders_swapped": 1,
    "left_motor_inverted": 0,
    "right_motor_inverted": 1,
    "left_encoder_inverted": 1,
    "right_encoder_inverted": 0,
    "counts_per_revolution": 2496,
    "wheel_radius": 0.0325,
    "wheel_separation": 0.14,
}


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(settings=SETTINGS) as simulator:
        yield simulator


def values(simulator: Simulator) -> dict[str, float]:
    """As the robot has them after a reset."""
    simulator.reset()
    with open_driver("serial", port=simulator.port) as robot:
        return {name: robot.parameters[name] for name in CHANGED}


def test_a_script_sets_up_a_robot(simulator: Simulator, tmp_path: Path) -> None:
    (tmp_path / "answers.yaml").write_text(ANSWERS)
    answers, plot = tmp_path / "answers.yaml", tmp_path / "drives.png"
    arguments = ("--answers", str(answers), "--plot", str(plot), "--json")
    result = run("setup", simulator.port, *arguments)
    assert result.returncode == 0, result.stderr
    (line,) = result.stdout.splitlines()
    findings = json.loads(line)
    assert findings["wiring"] == {
        "motors_swapped": False,
        "encoders_swapped": True,
        "left_motor_reversed": False,
        "right_motor_reversed": True,
        "left_encoder_reversed": True,
        "right_encoder_reversed": False,
    }
    assert findings["counts_per_revolution"] == 2496
    assert findings["problems"] == []
    assert findings["saved"] is True
    assert findings["rms_after_mps"] < 0.7 * findings["rms_before_mps"]
    assert plot.read_bytes().startswith(b"\x89PNG")
    saved = values(simulator)
    assert {name: saved[name] for name in FOUND} == FOUND
    assert saved["velocity_feedforward"] == findings["velocity_feedforward"]


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
    # A robot and a folder of its own for each run: what a stall has cut off is begun anew.
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


@pytest.mark.parametrize("moment", ["Both wheels turn forward", "Ticks per wheel turn"])
def test_killed_it_leaves_a_robot_that_stands_and_is_as_it_was(
    simulator: Simulator, tmp_path: Path, moment: str
) -> None:
    with person(simulator, state_folder(tmp_path)) as terminal:
        terminal.wait_for("Which wheel turned")
        terminal.press(b"lf\n")
        terminal.wait_for("the other wheel turn?")
        terminal.press(b"b\n")
        terminal.wait_for(moment)
        terminal.process.kill()
        wait_until(lambda: not simulator.get("drive_on") and simulator.get("stands_still"))
    with open_driver("serial", port=simulator.port) as robot:
        assert robot.parameters["encoders_swapped"] == 0
        assert robot.parameters["right_motor_inverted"] == 0


def test_a_simulated_robot_answers_by_itself() -> None:
    findings = run_json("setup", "--simulated", "--seed", "5", "--set", "motors_swapped=1")
    assert findings["wiring"]["motors_swapped"] is True
    assert findings["saved"] is True
    again = run_json("setup", "--simulated", "--seed", "5", "--set", "motors_swapped=1")
    assert again == findings
    named = run_json("setup", "--simulated", "--set", "left.motor_reversed=1")["wiring"]
    assert [name for name, wired in named.items() if wired] == ["left_motor_reversed"]


def test_a_simulated_person_finds_how_the_imu_is_mounted(tmp_path: Path) -> None:
    (tmp_path / "answers.yaml").write_text("imu: yes\ntune: no\n")
    options = ("--answers", str(tmp_path / "answers.yaml"), "--set", "left.motor_reversed=1")
    mounted = ("--set", "imu.forward=2", "--set", "imu.up=3", "--set", "imu.bias=-0.02")
    found = run_json("setup", "--simulated", *options, *mounted)["imu"]
    assert (found["forward"], found["up"], found["saved"]) == ("z", "-x", True)
    assert found["bias"] == pytest.approx([0.02, 0, 0], abs=0.0005)


def test_a_defect_ends_it_with_a_code_and_findings() -> None:
    result = run("setup", "--simulated", "--set", "left.blocked=1", "--json")
    assert result.returncode == errors.CommissioningFailed.exit_code
    findings = json.loads(result.stdout.splitlines()[-1])
    assert findings["problems"][0].startswith("left wheel blocked: ")
    assert findings["saved"] is False
    text = run("setup", "--simulated", "--set", "estop_open=1")
    assert "problem: e-stop contact open: " in text.stdout


def test_the_help_counts_its_questions() -> None:
    assert "about eleven questions" in " ".join(run("setup", "--help").stdout.split())


def test_on_the_floor_it_tunes_only() -> None:
    findings = run_json("setup", "--simulated", "--on-the-floor", "--plant", "25ga-1440")
    assert findings["wiring"] is None
    assert findings["problems"] == []
    assert findings["rms_after_mps"] < findings["rms_before_mps"]


def test_the_values_may_go_to_a_file(tmp_path: Path) -> None:
    kept = tmp_path / "robot.yaml"
    assert run_json("setup", "--simulated", "--keep", str(kept))["saved"] is False
    assert "counts_per_revolution: 360 tick" in kept.read_text()
    line = check_error(
        run("setup", "--simulated", "--keep", str(tmp_path / "no" / "file")), errors.OutputFailed
    )
    assert "choose a file" in line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mock",), "in a terminal, or answer them by --answers FILE"),
        (("mock", "--simulated"), "not both"),
        (("mock", "--seed", "1"), "add --simulated"),
        (("--simulated", "--set", "left.bloked=1"), "refused left.bloked"),
        (("--simulated", "--set", "left.blocked"), "give NAME=VALUE"),
        (("--simulated", "--plot", "drives.xyz"), "ends in .xyz: name it .png, .svg or .pdf"),
        (("--simulated", "--plot", "drives"), "ends in nothing: name it .png, .svg or .pdf"),
    ],
)
def test_wrong_arguments_are_refused(arguments: tuple[str, ...], message: str) -> None:
    assert message in check_error(run("setup", *arguments), errors.InvalidArgument)


def test_values_that_nothing_keeps_are_refused_first(tmp_path: Path) -> None:
    (tmp_path / "answers.yaml").write_text(ANSWERS)
    answers = ("--answers", str(tmp_path / "answers.yaml"))
    line = check_error(run("setup", "mock", *answers), errors.InvalidArgument)
    assert "wheelwire setup --simulated" in line
    (tmp_path / "robot.yaml").write_text(
        "driver: serial\nserial:\n  port: /dev/none\nparameters:\n  wheel_radius: 0.03\n"
    )
    line = check_error(run("setup", str(tmp_path / "robot.yaml"), *answers), errors.InvalidArgument)
    assert "sets wheel_radius each time" in line


PAGE = Path(__file__).parents[2] / "docs" / "first-hour.md"


def test_the_page_shows_what_the_screen_shows() -> None:
    (session,) = re.findall(r"^```console\n\$ (.*?)^```$", PAGE.read_text(), re.M | re.S)
    command, _, output = session.partition("\n")
    assert run(*command.split()[1:]).stdout == output


def test_the_page_names_every_defect() -> None:
    rows = re.findall(r"^\| (.*?) \| (`.*?`) \|$", PAGE.read_text(), re.M)
    assert rows == [
        (defect.name.format(side="left"), f"`{defect.variables}`".replace(", ", "`, `"))
        for defect in DEFECTS
    ]
