"""`wheelwire setup`, answered by a script, and of a robot of its own."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.cases import each
from support.command import check_error, run, run_json
from support.wrong_wiring import FOUND, SETTINGS, values
from wheelwire import errors
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.setup.problems import DEFECTS

pytestmark = pytest.mark.early
ANSWERS = """
raised: yes
first: left forward
second: backward
counts_per_revolution: tt-1-48
wheel_radius: 0.0325
wheel_separation: 0.14
tune: no
save: yes
"""


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(settings=SETTINGS) as simulator:
        yield simulator


def test_a_script_sets_up_a_robot(simulator: Simulator, tmp_path: Path) -> None:
    (tmp_path / "answers.yaml").write_text(ANSWERS)
    findings = run_json("setup", simulator.port, "--answers", str(tmp_path / "answers.yaml"))
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
    saved = values(simulator)
    assert {name: saved[name] for name in FOUND} == FOUND


def test_a_simulated_robot_answers_by_itself(tmp_path: Path) -> None:
    plot = tmp_path / "drives.png"
    options = ("--seed", "5", "--set", "motors_swapped=1", "--plot", str(plot))
    findings = run_json("setup", "--simulated", *options)
    assert findings["wiring"]["motors_swapped"] is True
    assert findings["saved"] is True
    assert findings["rms_after_mps"] < 0.7 * findings["rms_before_mps"]
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert run_json("setup", "--simulated", *options) == findings


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


@each(
    ("arguments", "message"),
    [
        ("mock", "in a terminal, or answer them by --answers FILE"),
        ("mock --simulated", "not both"),
        ("mock --seed 1", "add --simulated"),
        ("--simulated --set left.bloked=1", "refused left.bloked"),
        ("--simulated --set left.blocked", "give NAME=VALUE"),
        ("--simulated --plot drives.xyz", "ends in .xyz: name it .png, .svg or .pdf"),
        ("--simulated --plot drives", "ends in nothing: name it .png, .svg or .pdf"),
    ],
)
def test_wrong_arguments_are_refused(arguments: str, message: str) -> None:
    assert message in check_error(run("setup", *arguments.split()), errors.InvalidArgument)


PAGE = Path(__file__).parents[2] / "docs" / "first-hour.md"


def test_the_page_shows_what_the_screen_shows() -> None:
    (session,) = re.findall(r"^```console\n\$ (.*?)^```$", PAGE.read_text(), re.M | re.S)
    command, _, shown = session.partition("\n")
    printed = run(*command.split()[1:]).stdout
    parts = shown.split("...\n")
    assert re.fullmatch(".*".join(map(re.escape, parts)), printed, re.S)
    assert len(shown) > len(printed) / 2


def test_the_page_names_every_defect() -> None:
    text = PAGE.read_text().replace("\n  ", " ")
    listed = re.findall(r"^- ([^:\n]+): ((?:`[\w.]+`(?:, )?)+)$", text, re.M)
    assert listed == [
        (defect.name.format(side="left"), f"`{defect.variables}`".replace(", ", "`, `"))
        for defect in DEFECTS
    ]
