"""The generator, on a copy of the checkout."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from wheelwire_protocol.generate import __main__ as generate
from wheelwire_protocol.generate import cpp, markdown, python, typescript
from wheelwire_protocol.messages import MESSAGES

ROOT = Path(__file__).parents[3]
INPUTS = [
    ".clang-format",
    "protocol",
    "firmware/esp32",
    "host/wheelwire/simulation",
    "tests/support",
    "web/src/generated",
]
OUTPUTS = [
    "protocol/wheelwire_protocol/types.py",
    "protocol/MESSAGES.md",
    "protocol/vectors/generated.json",
    "protocol/wheelwire_protocol/core_abi.py",
    "host/wheelwire/simulation/fwsim_abi.py",
    "firmware/esp32/core/board_tables.hpp",
    "firmware/esp32/core/protocol.hpp",
    "firmware/esp32/core/sensor_tables.hpp",
    "firmware/esp32/explore/protocol_names.hpp",
    "firmware/esp32/main/self_test_protocol.hpp",
    "firmware/esp32/test/vectors.hpp",
    "tests/support/self_test_types.py",
    "web/src/generated/protocol.ts",
]
_APART = ("_tables", "_abi", "self_test_")
OF_MESSAGES = [name for name in OUTPUTS if not any(part in name for part in _APART)]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for name in INPUTS:
        source, target = ROOT / name, tmp_path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, target)
    return tmp_path


FROM_HERE = """
import runpy, sys
sys.meta_path[:] = [f for f in sys.meta_path if "editable" not in type(f).__module__]
runpy.run_module("wheelwire_protocol.generate", run_name="__main__", alter_sys=True)
"""
"""An editable installation would find the checkout before the copy."""


def run(checkout: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The copy's own generator, over the copy's own definitions."""
    return subprocess.run(
        [sys.executable, "-c", FROM_HERE, *arguments],
        cwd=checkout / "protocol",
        capture_output=True,
        text=True,
        check=False,
    )


def append(text: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(path.read_text("utf-8") + text, "utf-8")


def test_the_checkout_is_up_to_date() -> None:
    assert list(generate.stale(ROOT)) == []


def test_check_names_each_file_and_the_remedy(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # The formatters take most of the time, and give the same each time.
    formatted = generate._filtered
    once = cache(lambda command, text: formatted(list(command), text))
    monkeypatch.setattr(generate, "_filtered", lambda command, text: once(tuple(command), text))
    lines = [f"{name} differs from the definitions; run make gen" for name in OUTPUTS]
    for damage in (append("\n"), Path.unlink):
        for name in OUTPUTS:
            damage(checkout / name)
        assert generate.main(["--check", "--root", str(checkout)]) == 1
        assert sorted(capsys.readouterr().err.splitlines()) == sorted(lines)
        assert generate.main(["--root", str(checkout)]) == 0
        assert generate.main(["--check", "--root", str(checkout)]) == 0


def test_a_new_message_goes_through(checkout: Path) -> None:
    definitions = checkout / "protocol/wheelwire_protocol/messages.py"
    text = definitions.read_text("utf-8")
    new = 'class Brandnew(Request, id=0x1F):\n    "New."\n'
    definitions.write_text(text.replace("\nMESSAGES =", f"\n{new}\nMESSAGES ="), "utf-8")

    check = run(checkout, "--check")
    assert (check.returncode, check.stderr.count("run make gen")) == (1, len(OF_MESSAGES))
    assert run(checkout).returncode == 0
    assert run(checkout, "--check").returncode == 0
    assert "struct Brandnew" in (checkout / "firmware/esp32/core/protocol.hpp").read_text("utf-8")


def test_types_that_do_not_parse_are_rewritten(checkout: Path) -> None:
    (checkout / OUTPUTS[0]).write_text("<<<<<<< a conflict\n", "utf-8")
    assert run(checkout).stdout == f"{OUTPUTS[0]} written\n"
    assert run(checkout, "--check").returncode == 0


@pytest.mark.parametrize(
    "text", [python.generate(), cpp.generate(), markdown.generate(), typescript.generate()]
)
def test_every_message_and_field_is_there(text: str) -> None:
    for message in MESSAGES:
        assert message.name in text
        assert all(field.name in text for field in message.fields)
