"""How the command starts, ends and fails; without a robot."""

from __future__ import annotations

import json
import signal
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest

from support.command import PROGRAM, check_error, run
from wheelwire import errors
from wheelwire.cli import output


@pytest.mark.parametrize("option", ["-h", "--help"])
@pytest.mark.parametrize("command", [(), ("drive",), ("params",), ("params", "set")])
def test_help_is_asked_for_as_everywhere(command: tuple[str, ...], option: str) -> None:
    result = run(*command, option)
    assert result.returncode == 0
    assert "Usage: wheelwire" in result.stdout


@pytest.mark.parametrize("command", [(), ("params",)])
def test_without_a_command_the_commands_are_shown(command: tuple[str, ...]) -> None:
    result = run(*command)
    assert result.returncode == 2
    assert "Commands" in result.stdout
    assert result.stderr == ""


def test_version() -> None:
    assert run("--version").stdout == f"wheelwire {version('wheelwire')}\n"


def test_wrong_usage_is_one_line_that_names_the_help() -> None:
    result = run("params", "get")
    assert result.returncode == 2
    assert result.stderr == (
        "wheelwire: Missing argument 'NAME'; see `wheelwire params get --help`\n"
    )


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


def test_an_interrupt_while_it_starts_leaves_no_traceback(tmp_path: Path) -> None:
    """The signal comes in the middle of the imports, as a hasty Ctrl-C does."""
    (tmp_path / "typer.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    former = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background
    try:
        result = run("ports", PYTHONPATH=str(tmp_path))
    finally:
        signal.signal(signal.SIGINT, former)
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "")


def test_an_ascii_terminal_gets_ascii() -> None:
    """Help has frames and dots that ASCII has not."""
    result = run("--help", LC_ALL="POSIX", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0", COLUMNS="30")
    assert result.returncode == 0, result.stderr
    assert result.stdout.isascii()
    assert "monitor" in result.stdout


def test_demo_looks_at_its_folder_before_it_drives(tmp_path: Path) -> None:
    file = tmp_path / "taken"
    file.write_text("")
    line = check_error(run("demo", "--output", str(file)), errors.OutputFailed)
    assert str(file) in line
    assert "--output" in line


def test_brackets_are_shown_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    """They are no markup: `pip install 'wheelwire[tools]'` is to be copied."""
    output.print_facts("Facts", [("picture", "none: pip install 'wheelwire[tools]'")])
    output.console.print("pip install 'wheelwire[tools]'")
    assert capsys.readouterr().out.count("'wheelwire[tools]'") == 2
