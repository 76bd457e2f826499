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
    found = json.loads(run("params", "diff", second.port, str(file), "--json").stdout)
    assert found["different"]["wheel_radius"] == {"robot": 0.033, "file": 0.04, "unit": "m"}
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
