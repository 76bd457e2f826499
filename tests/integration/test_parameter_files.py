"""`wheelwire params export`, `import` and `diff`: one simulated robot's numbers on another."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from support.cases import each
from support.command import check_error, output, run, run_json
from wheelwire import errors
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.parameters import PARAMETERS

DIFFERENT = 22


@pytest.fixture(scope="module")
def robots() -> Iterator[tuple[Simulator, Simulator]]:
    with Simulator() as first, Simulator() as second:
        yield first, second


@pytest.fixture
def first(robots: tuple[Simulator, Simulator]) -> str:
    """A robot with numbers of its own."""
    port = robots[0].port
    run("params", "reset", port, "--yes")
    run("params", "set", port, "wheel_radius", "0.04")
    run("params", "set", port, "integral_gain", "12.5")
    return port


@pytest.fixture
def second(robots: tuple[Simulator, Simulator]) -> Iterator[Simulator]:
    """A robot with all defaults."""
    simulator = robots[1]
    yield simulator
    simulator.set("estop_open", 0)
    run("clear", simulator.port)
    run("params", "reset", simulator.port, "--yes")


@pytest.fixture
def file(first: str, tmp_path: Path) -> Path:
    result = run("params", "export", first)
    assert result.returncode == 0, result.stderr
    path = tmp_path / "first.yaml"
    path.write_text(result.stdout)
    return path


def value(robot: Simulator, name: str) -> float:
    return float(run_json("params", "get", robot.port, name)[name])


def test_one_robots_numbers_are_copied_to_another(
    first: str, second: Simulator, file: Path
) -> None:
    content = yaml.safe_load(file.read_text())
    assert content["board"] == "SIMULATED"
    assert content["board_id"] == run_json("info", first)["link"]["device"]["board_id"]
    assert content["parameters"]["wheel_radius"] == "0.04 m"
    assert list(content["parameters"]) == [p.name for p in PARAMETERS]
    assert output("params", "diff", first, str(file)) == (
        f"all {len(PARAMETERS)} values are equal\n"
    )

    different = run("params", "diff", second.port, str(file))
    assert different.returncode == DIFFERENT, different.stderr
    assert different.stderr == ""
    rows = [line.strip("│ ").split("│") for line in different.stdout.splitlines() if "│" in line]
    assert [[cell.strip() for cell in row] for row in rows] == [
        ["wheel_radius", "0.033", "0.04", "m"],
        ["integral_gain", "16", "12.5", "duty/m"],
    ]
    assert value(second, "wheel_radius") == 0.033  # looking changes nothing

    imported = output("params", "import", second.port, str(file))
    assert "the values of SIMULATED " in imported
    assert "wheel_radius: 0.033 -> 0.04 m\nintegral_gain: 16 -> 12.5 duty/m\n" in imported
    assert imported.endswith(
        f"2 of {len(PARAMETERS)} values changed, until the next reset; --save keeps them\n"
    )
    assert run("params", "diff", second.port, str(file)).returncode == 0
    second.reset()
    assert value(second, "wheel_radius") == 0.033

    assert run_json("params", "import", second.port, str(file), "--save")["saved"] is True
    second.reset()
    assert value(second, "wheel_radius") == 0.04


def test_json_in_and_out(first: str, second: Simulator, tmp_path: Path) -> None:
    path = tmp_path / "first.json"
    path.write_text(run("params", "export", first, "--json").stdout)
    exported = json.loads(path.read_text())
    result = run("params", "diff", second.port, str(path), "--json")
    assert result.returncode == DIFFERENT
    different = json.loads(result.stdout)
    assert different["different"]["wheel_radius"] == {"robot": 0.033, "file": 0.04, "unit": "m"}
    assert different["not_in_file"] == []
    assert different["file_board_id"] == exported["board_id"]
    assert different["robot_board"] == "SIMULATED"
    imported = run_json("params", "import", second.port, str(path))
    assert imported["changed"] == {"wheel_radius": 0.04, "integral_gain": 12.5}
    assert imported["saved"] is False
    assert imported["state"] == "IDLE"


def test_a_file_of_some_values_leaves_the_others_alone(second: Simulator, tmp_path: Path) -> None:
    path = tmp_path / "some.yaml"
    path.write_text("board: LINUX\nboard_id: '1'\nparameters: {control_rate_hz: 100}\n")
    run("params", "set", second.port, "path_gain", "1")
    result = run("params", "diff", second.port, str(path))
    assert result.returncode == DIFFERENT
    assert "not in the file, not compared: wheel_radius, " in result.stdout
    text = run("params", "import", second.port, str(path), "--save").stdout
    assert "the values of LINUX 1 are copied to SIMULATED" in text
    assert "control_rate_hz: the defaults of these two kinds of boards differ" in text
    second.reset()
    assert value(second, "control_rate_hz") == 100
    assert value(second, "path_gain") == 2  # it was only tried, and the file does not have it


def test_what_acts_after_a_reset_says_so(second: Simulator, tmp_path: Path) -> None:
    path = tmp_path / "some.yaml"
    path.write_text("parameters: {pwm_frequency_hz: 18000 Hz}\n")
    text = run("params", "import", second.port, str(path)).stdout
    assert "pwm_frequency_hz takes effect after the next reset, and only if saved\n" in text


def test_a_refused_value_leaves_the_robot_as_it_was(second: Simulator, tmp_path: Path) -> None:
    """The switch of the contact cannot be changed while an e-stop is latched."""
    path = tmp_path / "some.yaml"
    path.write_text("parameters: {estop_input_enabled: 0, wheel_radius: 0.05, path_gain: 1}\n")
    run("estop", second.port)
    line = check_error(run("params", "import", second.port, str(path)), errors.ImportFailed)
    assert "estop_input_enabled = 0 was not set: the device refused" in line
    assert "The previous values are active again." in line
    assert value(second, "wheel_radius") == 0.033
    assert value(second, "path_gain") == 2
    run("clear", second.port)
    assert run("params", "import", second.port, str(path)).returncode == 0


FAST = {"control_rate_hz": 1000, "overrun_limit_us": 2000, "stream_rate_hz": 500}
SLOW = {"control_rate_hz": 100, "overrun_limit_us": 20000, "stream_rate_hz": 50}
"""From each to the other, some values are taken alone only after others."""


def test_the_order_of_the_lines_does_not_matter(second: Simulator, tmp_path: Path) -> None:
    path = tmp_path / "some.yaml"
    for values, order in ((FAST, 1), (SLOW, 1), (FAST, -1), (SLOW, -1)):
        lines = [f"  {name}: {value}\n" for name, value in values.items()]
        path.write_text("parameters:\n" + "".join(lines[::order]))
        result = run("params", "import", second.port, str(path))
        assert result.returncode == 0, result.stderr
        assert {name: value(second, name) for name in values} == values


def test_values_that_contradict_each_other_are_named_and_not_set(
    second: Simulator, tmp_path: Path
) -> None:
    path = tmp_path / "some.yaml"
    path.write_text(
        "parameters: {wheel_radius: 0.05, control_rate_hz: 200, overrun_limit_us: 2000}\n"
    )
    line = check_error(run("params", "import", second.port, str(path)), errors.ImportFailed)
    assert "overrun_limit_us is less than 1.5 control periods (control_rate_hz)" in line
    assert "The previous values are active again." in line
    assert value(second, "wheel_radius") == 0.033


def test_the_import_reports_an_estop_that_it_latched(second: Simulator, tmp_path: Path) -> None:
    run("params", "set", second.port, "estop_input_enabled", "0")
    second.set("estop_open", 1)
    path = tmp_path / "some.yaml"
    path.write_text("parameters: {estop_input_enabled: 1, wheel_radius: 0.05}\n")
    result = run("params", "import", second.port, str(path))
    assert result.returncode == 0, result.stderr
    assert "an e-stop is latched" in result.stdout
    assert value(second, "wheel_radius") == 0.05


@each(
    ("text", "hint"),
    [
        ("parameters: {wheel_radius: 33}", "0.033 is 33 mm"),
        ("parameters: {wheel_radus: 0.03}", "did you mean"),
        ("driver: serial", "give ROBOT first, then FILE"),
        ("", "`wheelwire params export` writes such a file"),
    ],
)
def test_errors_are_one_line_that_helps(text: str, hint: str, tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(text)
    for command in ("import", "diff"):
        # Before the robot is opened: the port does not exist.
        result = run("params", command, "/dev/none", str(path))
        assert hint in check_error(result, errors.ConfigurationError)


def test_the_robot_may_be_left_out(second: Simulator, file: Path) -> None:
    robot = {"WHEELWIRE_ROBOT": second.port}
    assert run("params", "diff", str(file), **robot).returncode == DIFFERENT
    assert run("params", "import", str(file), **robot).returncode == 0
    assert run("params", "diff", str(file), **robot).returncode == 0
    assert "wheel_radius: 0.04 m" in run("params", "export", **robot).stdout
    line = check_error(run("params", "diff", second.port, **robot), errors.InvalidArgument)
    assert "give ROBOT first, then FILE" in line
    assert run("params", "diff").returncode == 2
    assert run("params", "diff", "a", "b", "c").returncode == 2
    assert run("params", "diff", "a", "b", "--svae").returncode == 2


def test_a_robots_file_keeps_what_it_sets(second: Simulator, file: Path, tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    robot.write_text(
        f"driver: serial\nserial: {{port: {second.port}}}\nparameters: {{wheel_radius: 0.05}}\n"
    )
    line = check_error(run("params", "import", str(robot), str(file)), errors.InvalidArgument)
    assert "sets wheel_radius each time the robot is opened: change it in that file" in line
    robot.write_text(robot.read_text().replace("0.05", "0.04"))
    assert run("params", "import", str(robot), str(file)).returncode == 0


def test_mock_saves_nothing(file: Path) -> None:
    line = check_error(run("params", "import", "mock", str(file), "--save"), errors.InvalidArgument)
    assert "cannot save parameters" in line
    assert "for this command only" in run("params", "import", "mock", str(file)).stdout
