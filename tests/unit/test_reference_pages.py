"""The reference pages say what the code says."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import typer
import yaml

import wheelwire
import wheelwire.aio
from support.cases import each
from wheelwire import errors
from wheelwire.cli.app import application
from wheelwire.pi.pins import Pins
from wheelwire.tools.files import robot as config
from wheelwire.tools.files import robot as robot_file
from wheelwire_protocol.codes import Fault

DOCS = Path(__file__).parents[2] / "docs"
ROBOT_FILE = (DOCS / "robot-file.md").read_text()


def rows(page: str) -> list[list[str]]:
    """The cells of all rows of all tables, without headings."""
    lines = [line for line in (DOCS / page).read_text().splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if not set(row[0]) <= {"-"}]


def test_the_api_reference_lists_every_public_name() -> None:
    page = (DOCS / "api.md").read_text()
    shown = re.findall(r"^\.\. auto(?:function|class|exception):: wheelwire\.(\w+)$", page, re.M)
    assert sorted(shown) == sorted(set(wheelwire.__all__) - {"__version__", "aio"})
    assert ".. automodule:: wheelwire.aio\n   :members:\n" in page
    for module in (wheelwire, wheelwire.aio):
        things = {name: getattr(module, name) for name in module.__all__ if name != "__version__"}
        assert [name for name, thing in things.items() if not inspect.getdoc(thing)] == []


def test_the_exit_codes_list_every_error() -> None:
    told = {row[1].strip("`"): (row[0], row[2]) for row in rows("exit-codes.md")}
    for name, kind in vars(errors).items():
        if isinstance(kind, type) and issubclass(kind, errors.WheelwireError):
            code, meaning = told.pop(name)
            assert code == str(kind.exit_code)
            if name != "WheelwireError":
                assert meaning == " ".join((inspect.getdoc(kind) or "").split("\n\n")[0].split())
    assert set(told) == {"error", "", "UsageError"}


def test_the_page_lists_every_key_of_a_robots_file_with_its_default() -> None:
    keys_and_defaults = re.findall(r"^- (`.+?`)(?: \(`(.+?)`\))?: ", ROBOT_FILE, re.M)
    listed = {
        key: default or "none"
        for names, default in keys_and_defaults
        for key in re.findall(r"`(.+?)`", names)
    }
    robot = config.RobotConfig()
    sections: dict[str, Any] = {"pigpio": robot.pigpio, "serial": robot.serial, "gpio": robot.gpio}
    expected = {"driver": "none", "store": "none", "board": "none", "parameters": "none"}
    for name, pin in inspect.signature(Pins).parameters.items():
        expected[f"pins.{name}"] = "none" if pin.default is None else str(pin.default)
    for section, settings in sections.items():
        for field in dataclasses.fields(settings):
            value = getattr(settings, field.name)
            written = str(value).lower() if isinstance(value, bool) else str(value)
            expected[f"{section}.{field.name}"] = "none" if value is None else written
    assert {key: default for key, default in listed.items() if key in expected} == expected
    assert {*robot_file.TOP, *config.SECTIONS_OF_DRIVERS, "pins", "parameters"} == {
        key.partition(".")[0] for key in expected
    }


def test_the_pis_pins_are_those_of_the_default_robot() -> None:
    table = (DOCS / "wiring.md").read_text().partition("### A Raspberry Pi's own pins")[2]
    told = dict(re.findall(r"^\| ([^|]+) \| ([\d, ]+) \| [\d, ]+ \|$", table, re.M))
    pins = Pins()
    assert {name: tuple(map(int, numbers.split(","))) for name, numbers in told.items()} == {
        "left EN (ENA)": (pins.left.enable,),
        "left IN1, IN2": (pins.left.in1, pins.left.in2),
        "right EN (ENB)": (pins.right.enable,),
        "right IN1, IN2 (IN3, IN4)": (pins.right.in1, pins.right.in2),
        "left encoder A, B": (pins.left.encoder_a, pins.left.encoder_b),
        "right encoder A, B": (pins.right.encoder_a, pins.right.encoder_b),
    }


def test_the_page_lists_every_other_name_in_a_robots_file() -> None:
    listed = dict(re.findall(r"^- `(\w+)`: `(\S+)`$", ROBOT_FILE, re.M))
    assert listed == {**robot_file.ALIASES, robot_file.MAX_RPM: "parameters.velocity_feedforward"}


def test_the_file_on_the_page_is_accepted() -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", ROBOT_FILE, re.S)
    robot = config.parse_config(yaml.safe_load(text))
    assert robot.driver == "serial"
    assert robot.parameters["wheel_radius"] == 0.033


def test_troubleshooting_names_every_fault() -> None:
    text = (DOCS / "troubleshooting.md").read_text()
    assert [fault.name for fault in Fault if f"`{fault.name}`" not in text] == []


PAGES = sorted({*DOCS.glob("*.md"), *DOCS.glob("*/*.md"), DOCS.parent / "README.md"})


@cache
def command_line() -> Any:
    return typer.main.get_command(application())


@each("page", PAGES, ids=lambda page: page.name)
def test_commands_on_a_page_exist(page: Path) -> None:
    command = command_line()
    for line in re.findall(
        r"(?:^|[`$;&] ?|bin/)wheelwire ([a-z][^`\n#;&|]*)", page.read_text(), re.M
    ):
        words = line.partition(" -- ")[0].split()  # the rest is for another program
        known = command
        # A group's own options come first: `wheelwire sim --plant NAME`.
        while hasattr(known, "commands") and words and not words[0].startswith("--"):
            assert words[0] in known.commands, line
            known = known.commands[words.pop(0)]
        options = {option for parameter in known.params for option in parameter.opts}
        given = {word for word in words if word.startswith("--")}
        assert given <= {*options, "--help"}, line


def test_the_index_lists_every_decision() -> None:
    index = (DOCS / "adr" / "README.md").read_text().replace("\n  ", " ")
    listed = re.findall(r"^- (\d+): (.+)$", index, re.M)
    titles = []
    for page in sorted(DOCS.glob("adr/0*.md")):
        number, title = re.findall(r"\A# (\d+)\. (.+)\n", page.read_text())[0]
        assert page.name.startswith(f"{int(number):04}-")
        titles.append((number, f"[{title}]({page.name})"))
    assert listed == titles


@each("page", PAGES, ids=lambda page: page.name)
def test_links_on_a_page_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        there = page.parent / file if file else page
        assert there.exists(), target
        if anchor:
            assert anchor in anchors(there), target


def anchors(page: Path) -> set[str]:
    """Anchors of the headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.M)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_files_that_answer_a_question_about_the_code_exist() -> None:
    files: list[str] = []
    for page, heading in (("architecture", "## Where is"), ("first-change", "## What an")):
        text = (DOCS / f"{page}.md").read_text()
        files += re.findall(r"`((?:[\w.]+/)+\w*\.\w+)`", text[text.index(heading) :])
    assert len(files) >= 95
    assert [file for file in files if not (DOCS.parent / file).exists()] == []


def test_the_page_of_commands_closes_its_brackets() -> None:
    usages = re.findall(r"`([^`]+)`", (DOCS / "cli.md").read_text())
    assert [usage for usage in usages if usage.count("[") != usage.count("]")] == []


KINDS = ("Tutorial", "How to", "Reference")


def below(entries: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """All of them, at any depth."""
    for entry in entries:
        yield entry
        yield from below(entry.get("entries", []))


def test_every_page_is_of_one_kind_and_only_a_reference_is_long() -> None:
    kinds: dict[str, str] = {}
    for group in yaml.safe_load((DOCS / "_toc.yml").read_text())["subtrees"]:
        kind = group["caption"].partition(":")[0]
        assert kind in KINDS
        for entry in below(group["entries"]):
            names = entry.get("file") or entry["glob"]
            for page in DOCS.glob(f"{names}.md"):
                name = page.relative_to(DOCS).as_posix()
                assert kinds.setdefault(name, kind) == kind, name
    assert set(kinds) == {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")} - {
        "index.md"
    }
    words = {page: len((DOCS / page).read_text().split()) for page in [*kinds, "index.md"]}
    assert {
        page for page in words if words[page] > 2000 and kinds.get(page) != "Reference"
    } == set()
