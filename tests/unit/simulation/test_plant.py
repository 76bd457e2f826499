"""Plants as data: the built-in ones are those of their data sheets, and a file is checked."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any, cast

import pytest

from support.processes import captured
from support.virtual import VirtualRobot
from wheelwire.errors import ConfigurationError
from wheelwire.tools.files.plant import SHIPPED, load_plant, shipped_plants
from wheelwire.tools.files.reading import reading

PLANTS = ["25ga-1440", "jgb37-520", "tt-1-48"]
TO_TERMINALS = {"bridge.drop_v": 0.0, "bridge.drop_ohm": 0.0}


def test_three_plants_are_built_in() -> None:
    assert shipped_plants() == PLANTS


@pytest.mark.parametrize("name", PLANTS)
def test_every_figure_has_its_source_or_says_that_it_is_assumed(name: str) -> None:
    assert load_plant(name).title
    with reading(SHIPPED / f"{name}.yaml", "plant") as content:
        values = cast("dict[str, Any]", content)["variables"].values()
    assert all(value.get("source") or value.get("assumed") for value in values)
    assert any(value.get("assumed") for value in values)


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_runs_and_stalls_as_its_data_sheet_says(name: str) -> None:
    rated = load_plant(name).settings
    at_rating = {**rated, **TO_TERMINALS, "supply_v": rated["motor.supply_v"], "battery_v": 0.0}
    robot = VirtualRobot(**at_rating, wheels_free=1).open()
    robot.drive_duty(1.0, -1.0, 1.0)
    rim = rated["motor.no_load_rpm"] * 2 * math.pi / 60 * rated["wheel_radius_m"]
    assert robot.sim.get("true.left_mps") == pytest.approx(rim, rel=0.01)
    assert robot.sim.get("true.right_mps") == pytest.approx(-rim, rel=0.01)
    kt = rated["motor.stall_torque_nm"] / rated["motor.stall_current_a"]
    speed = rim / rated["wheel_radius_m"]
    friction = rated["friction.coulomb_nm"] + rated["friction.viscous_nms"] * speed
    assert robot.sim.get("left.current_a") == pytest.approx(friction / kt, rel=0.02)
    blocked = VirtualRobot(**at_rating, **{"left.blocked": 1}).open()
    blocked.drive_duty(1.0, 0.0, 0.4)
    assert blocked.sim.get("left.current_a") == pytest.approx(rated["motor.stall_current_a"])


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_drives_on_the_floor_behind_its_bridge(name: str) -> None:
    plant = load_plant(name).settings
    robot = VirtualRobot(**plant).open()
    robot.set_parameter("counts_per_revolution", plant["counts_per_revolution"])
    robot.set_parameter("wheel_radius", plant["wheel_radius_m"])
    robot.drive_duty(0.5, 0.5, 1.0)
    assert robot.sim.get("true.left_mps") > 0.1
    assert robot.sample.left_mps == pytest.approx(robot.sim.get("true.left_mps"), rel=0.05)


def test_a_file_is_a_plant_too(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(
        "title: Mine\nvariables:\n  mass_kg: 1\n  slope_rad: {value: 0.1, assumed: so}\n"
    )
    plant = load_plant(path)
    assert (plant.title, plant.settings) == ("Mine", {"mass_kg": 1.0, "slope_rad": 0.1})


def test_an_unknown_plant_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="25ga-1440, jgb37-520, tt-1-48"):
        load_plant("nothing")
    (tmp_path / "bad.yaml").write_text("{")
    with pytest.raises(ConfigurationError, match=r"bad\.yaml"):
        load_plant(tmp_path / "bad.yaml")


def test_the_pages_tables_are_what_simulator_and_plants_say() -> None:
    tool = Path(__file__).parents[3] / "tools" / "write_simulator_page.py"
    result = captured(sys.executable, tool, "--check")
    assert result.returncode == 0, result.stderr
