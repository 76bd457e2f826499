"""`wheelwire help` finds every page, and errors name pages that exist."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from support.cases import each
from support.command import run
from wheelwire import errors
from wheelwire.cli.app import application
from wheelwire.cli.help import PAGE_OF, help_page, pages


def shown(capsys: pytest.CaptureFixture[str], page: str | None) -> str:
    help_page(page)
    return capsys.readouterr().out


def test_it_lists_every_page_with_its_title(capsys: pytest.CaptureFixture[str]) -> None:
    lines = dict(re.split(r"  +", line, maxsplit=1) for line in shown(capsys, None).splitlines())
    assert set(lines) == set(pages())
    assert lines["troubleshooting"] == "Troubleshooting, by symptom"
    assert lines["tutorial"]
    assert lines["messages"]


@each("name", pages())
def test_each_page_is_shown_whole(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = pages()[name].read_text("utf-8")
    assert shown(capsys, name).split() == re.sub(r"<!--.*?-->", "", text).split()


@pytest.mark.parametrize(
    "address",
    ["troubleshooting/port", "troubleshooting/the-port", "docs/troubleshooting.md#the-port"],
)
def test_a_section_is_shown_alone(address: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, address)
    assert text.startswith("## The port\n")
    assert re.findall("^#.*", text, re.M) == ["## The port"]


def test_a_section_ends_at_the_next_one_of_its_level(capsys: pytest.CaptureFixture[str]) -> None:
    # Comments in blocks of commands begin with #, too.
    text = shown(capsys, "pi-pins/a-process-for-the-pins")
    assert "### A service of its own" in text
    assert "systemd/system/wheelwire.service" in text
    assert "## Tick loss" not in text


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("trobleshooting", "did you mean troubleshooting"),
        ("troubleshooting/wings", "the-port"),
        ("", "lists them"),
        ("../README", "lists them"),
    ],
)
def test_a_page_that_is_not_there_says_what_is(address: str, says: str) -> None:
    with pytest.raises(typer.BadParameter, match=says):
        help_page(address)


def found(*words: str) -> list[str]:
    result = CliRunner().invoke(application(), ["help", *words])
    assert result.exit_code == 0, result.output
    return [line.rstrip() for line in result.output.splitlines()]


def test_a_word_finds_the_commands_and_the_sections_that_mention_it() -> None:
    first, *lines = found("PLOT")
    assert first == "no page or command is called 'PLOT'; these mention it:"
    called = [line.split("  ")[0] for line in lines]
    # By name, option and text; the help itself is no find.
    by_name = [name for name in called if not name.startswith("wheelwire help")]
    assert by_name == [
        f"wheelwire {name}" for name in ("setup", "tune", "monitor", "why", "log plot")
    ]
    assert any(
        line.endswith("Show wheel speeds, duties, state, and why it stopped.") for line in lines
    )
    assert "wheelwire help recording/look-at-it" in called
    assert len(called) <= len(by_name) + 8


def test_words_of_a_symptom_find_its_section() -> None:
    assert found("hums", "but", "does") == found("hums but does")
    assert found("hums", "but", "does")[1:] == ["wheelwire help troubleshooting/it-does-not-drive"]
    # Troubleshooting comes before all others.
    assert found("fuse")[1] == "wheelwire help troubleshooting/it-does-not-drive"


@each("words", [("setup",), ("troubleshooting/port",), ("log", "plot"), ("docs/wiring.md#levels",)])
def test_what_is_a_page_or_a_command_is_not_searched(words: tuple[str, ...]) -> None:
    assert not any("mention it" in line for line in found(*words))


def test_what_nothing_mentions_names_the_nearest_command() -> None:
    result = CliRunner().invoke(application(), ["help", "montor"])
    assert result.exit_code == 2
    said = " ".join(re.sub("[│╭╮╰╯─]", " ", result.output).split())
    assert "no page or command is called 'montor' or mentions it; did you mean monitor?" in said


@each("kind", PAGE_OF)
def test_an_error_names_a_page_that_is_there(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert issubclass(getattr(errors, kind), errors.WheelwireError)
    assert shown(capsys, PAGE_OF[kind]).startswith("#")


def test_the_message_of_an_error_ends_with_its_page() -> None:
    result = run("info", "/dev/ttyUSB-none")
    assert result.returncode == errors.PortUnavailable.exit_code
    assert result.stderr.rstrip().endswith("(more: wheelwire help troubleshooting/port)")
    assert run("help", "troubleshooting/port").stdout.startswith("## The port")


def commands(command: Any, path: str = "wheelwire") -> Iterator[tuple[str, Any]]:
    yield path, command
    for name, subcommand in getattr(command, "commands", {}).items():
        yield from commands(subcommand, f"{path} {name}")


def test_the_help_of_a_command_ends_with_a_page_that_is_there(
    capsys: pytest.CaptureFixture[str],
) -> None:
    ends = {
        path: command.epilog for path, command in commands(typer.main.get_command(application()))
    }
    assert ends.pop("wheelwire") == "More: wheelwire help"
    assert ends.pop("wheelwire help") is None
    assert ends["wheelwire params set"] == ends["wheelwire params"]
    for path, end in ends.items():
        address = end.removeprefix("More: wheelwire help ")
        assert shown(capsys, address).startswith("#"), path
