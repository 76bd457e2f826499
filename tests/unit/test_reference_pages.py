"""The reference pages say what the code says."""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path

import yaml

from wheelwire import config, errors
from wheelwire.linux_mcu.pins import Pins

DOCS = Path(__file__).parents[2] / "docs"


def rows(page: str) -> list[list[str]]:
    """The cells of all rows of all tables, without headings."""
    lines = [line for line in (DOCS / page).read_text().splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if not set(row[0]) <= {"-"}]


def test_every_error_has_its_row_among_the_exit_codes() -> None:
    told = {row[1].strip("`"): (row[0], row[2]) for row in rows("exit-codes.md")}
    for name, kind in vars(errors).items():
        if isinstance(kind, type) and issubclass(kind, errors.WheelwireError):
            code, meaning = told.pop(name)
            assert code == str(kind.exit_code)
            if name != "WheelwireError":
                assert meaning == " ".join((inspect.getdoc(kind) or "").split("\n\n")[0].split())
    assert set(told) == {"error", "", "UsageError"}


def test_no_exit_code_is_there_twice() -> None:
    codes = [row[0] for row in rows("exit-codes.md") if re.fullmatch(r"\d+", row[0])]
    assert len(codes) == len(set(codes))


def test_every_key_of_a_robots_file_has_its_row_with_its_default() -> None:
    told = {row[0].strip("`"): row[1].strip("`") for row in rows("robot-file.md")}
    robot = config.RobotConfig()
    sections = {
        "pins": Pins(),
        "pigpio": robot.pigpio,
        "serial": robot.serial,
        "gpio": robot.gpio,
    }
    expected = {"driver": "none", "store": "none", "parameters": "none"}
    for section, settings in sections.items():
        for field in dataclasses.fields(settings):
            value = getattr(settings, field.name)
            expected[f"{section}.{field.name}"] = "none" if value is None else str(value)
    keys = {key: default for key, default in told.items() if key in expected}
    assert keys == expected
    assert set(config._TOP) == {key.partition(".")[0] for key in expected}


def test_every_other_name_in_a_robots_file_has_its_row() -> None:
    told = {row[0].strip("`"): row[1].strip("`") for row in rows("robot-file.md")}
    for name, key in {**config.ALIASES, config.MAX_RPM: "parameters.velocity_feedforward"}.items():
        assert told[name] == key


def test_the_file_that_the_page_shows_is_taken() -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", (DOCS / "robot-file.md").read_text(), re.S)
    robot = config.parse_config(yaml.safe_load(text))
    assert robot.driver == "serial"
    assert robot.parameters["wheel_radius"] == 0.033
