"""When `monitor` takes the whole screen."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path
from types import SimpleNamespace

import pytest

from wheelwire.cli import view


def terminal(encoding: str = "utf-8") -> SimpleNamespace:
    """A stream at a terminal."""
    return SimpleNamespace(isatty=lambda: True, encoding=encoding)


@pytest.fixture(autouse=True)
def streams(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    streams = SimpleNamespace(stdin=terminal(), stdout=terminal(), stderr=terminal())
    monkeypatch.setattr(view, "sys", streams)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(view, "find_spec", lambda _: importlib.util.find_spec("json"))
    return streams


def test_a_terminal_and_the_package_are_enough() -> None:
    assert view.can_show()


@pytest.mark.parametrize("name", ["stdin", "stdout", "stderr"])
def test_each_stream_has_to_be_a_terminal(streams: SimpleNamespace, name: str) -> None:
    setattr(streams, name, io.StringIO())
    assert not view.can_show()


def test_a_dumb_terminal_gets_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    assert not view.can_show()


def test_a_terminal_without_braille_gets_lines(streams: SimpleNamespace) -> None:
    streams.stdout = terminal("ascii")
    assert not view.can_show()


def test_without_the_package_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(view, "find_spec", lambda _: None)
    assert not view.can_show()
    (said,) = capsys.readouterr().err.splitlines()
    assert "pip install 'wheelwire[view]'" in said


@pytest.mark.parametrize(
    ("text", "drives"),
    [
        ("driver: serial\nserial: {port: /dev/ttyUSB0}\n", True),
        ("driver: serial\nserial: {port: /dev/ttyUSB0}\nparameters: {max_duty: 0.5}\n", False),
        ("driver: mock\nparameters: {max_duty: 0.5}\n", True),
    ],
)
def test_a_file_that_sets_what_a_look_leaves_out_is_not_driven(
    tmp_path: Path, text: str, *, drives: bool
) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(text)
    reason = view._cannot_drive(str(file))
    assert (not reason) is drives
    assert drives or f"wheelwire teleop {file}" in reason
