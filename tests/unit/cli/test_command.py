"""How the command starts, ends and fails; without a robot."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from support.command import PROGRAM, check_error, run
from support.processes import captured
from wheelwire import errors
from wheelwire.cli import output
from wheelwire.cli.registry import commands


@pytest.mark.parametrize("option", ["-h", "--help"])
@pytest.mark.parametrize("command", [(), ("drive",), ("params",), ("params", "set")])
def test_help_is_asked_for_as_everywhere(command: tuple[str, ...], option: str) -> None:
    result = run(*command, option)
    assert result.returncode == 0
    assert "Usage: wheelwire" in result.stdout


@pytest.mark.parametrize(("command", "heading"), [((), "Drive"), (("params",), "Commands")])
def test_without_a_command_the_commands_are_shown(command: tuple[str, ...], heading: str) -> None:
    result = run(*command)
    assert result.returncode == 2
    assert f"─ {heading} ─" in result.stdout
    assert result.stderr == ""


def test_the_help_lists_every_command_in_four_groups() -> None:
    _, _, groups = run("--help").stdout.partition("─ Options ─")
    headings = re.findall(r"^╭─ (.*?) ─", groups, re.M)
    assert headings == ["Build a robot", "Drive", "Look, and find out why", "Without a robot"]
    shown = re.findall(r"^│ ([a-z]+)  ", groups, re.M)
    assert sorted(shown) == sorted(command.name for command in commands())


def test_each_command_is_found_by_its_first_word_alone() -> None:
    found = {command.name: commands(command.name) for command in commands()}
    # It tells of the others.
    assert found.pop("help") == commands()
    assert found == {command.name: [command] for command in commands() if command.name != "help"}


def test_version() -> None:
    assert run("--version").stdout == f"wheelwire {version('wheelwire')}\n"


@pytest.mark.parametrize(
    ("arguments", "kind", "code"),
    [
        (("info", "/dev/no-such-port"), "PortUnavailable", errors.PortUnavailable.exit_code),
        (("params", "set", "mock", "max_duty"), "UsageError", 2),
        (("nonsense",), "UsageError", 2),
    ],
)
def test_an_error_is_json_where_results_are(
    arguments: tuple[str, ...], kind: str, code: int
) -> None:
    result = run(*arguments, "--json")
    assert (result.returncode, result.stdout) == (code, "")
    told = json.loads(result.stderr)
    assert (told["error"], told["exit_code"]) == (kind, code)
    assert told["message"] in run(*arguments).stderr


@pytest.mark.parametrize("arguments", [("ports",), ("ports", "--json"), ("--help",)])
def test_a_full_disk_is_one_line(arguments: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [*PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert result.returncode == errors.OutputFailed.exit_code
    (line,) = result.stderr.splitlines()
    assert "cannot write the output: No space left on device" in line


@pytest.mark.parametrize("moment", ["run", "_result", "_open_closed_streams", "print_error"])
def test_an_interrupt_at_any_moment_is_one_line(moment: str) -> None:
    program = (
        "import os, signal, sys\nfrom wheelwire.cli import app, main\n"
        f"before = app.{moment}\n"
        "def interrupted(*a, **k):\n    os.kill(os.getpid(), signal.SIGINT)\n"
        "    return before(*a, **k)\n"
        f"app.{moment} = interrupted\nsys.argv = ['wheelwire', 'board', 'show', 'nosuch']\nmain()"
    )
    result = captured(sys.executable, "-c", program)
    assert result.returncode == 130
    assert result.stderr.splitlines()[-1] == "wheelwire: interrupted"
    assert "Traceback" not in result.stderr


@pytest.mark.whole
@pytest.mark.parametrize("closed", ["0<&-", "1>&-", "0<&- 1>&- 2>&-"])
@pytest.mark.parametrize("command", ["board init", "board show l298n", "drive mock", "setup"])
def test_closed_streams_are_no_traceback(tmp_path: Path, command: str, closed: str) -> None:
    program = " ".join(map(shlex.quote, PROGRAM))
    result = captured("sh", "-c", f"exec {program} {command} {closed}", cwd=tmp_path, timeout=60)
    assert "Traceback" not in result.stderr
    assert result.returncode in (0, 10, 19, 21), result.stderr
    if command == "board init" and "2>" not in closed and "0<" in closed:
        assert "standard input has ended" in result.stderr.splitlines()[-1]


def test_demo_looks_at_its_folder_before_it_drives(tmp_path: Path) -> None:
    file = tmp_path / "taken"
    file.write_text("")
    line = check_error(run("demo", "--output", str(file)), errors.OutputFailed)
    assert str(file) in line
    assert "--output" in line


def test_brackets_are_shown_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    """They are not markup: users copy `pip install 'wheelwire[tools]'`."""
    output.print_facts("Facts", [("picture", "none: pip install 'wheelwire[tools]'")])
    output.console.print("pip install 'wheelwire[tools]'")
    assert capsys.readouterr().out.count("'wheelwire[tools]'") == 2
