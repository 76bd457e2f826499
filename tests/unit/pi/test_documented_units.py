"""The units of systemd in the documentation have what the programs in them need."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from support.cases import each
from support.confined import NOBODY
from support.processes import captured
from support.units import EMULATED, NOT_EMULATED, Unit, documented_units
from wheelwire.pi.gpio import gpiozero

UNITS = documented_units()
OURS = [unit for unit in UNITS if any("wheelwire" in word for word in unit.command)]
PINS = [unit for unit in OURS if "mcu" in unit.command]
PROGRAM = """
import json, os, sys
from wheelwire.pi.gpio.gpiozero import LGPIO_FOLDER, _give_lgpio_a_folder
user, cwd = int(sys.argv[1]), sys.argv[2]
if user:
    os.setgroups([])
    os.setgid(user)
    os.setuid(user)
os.chdir(cwd)
_give_lgpio_a_folder()
folder = os.environ.get(LGPIO_FOLDER) or os.getcwd()
open(os.path.join(folder, ".lgd-nfy-test"), "w").close()
print(json.dumps([folder, os.getcwd()]))
"""


def test_the_pages_have_units() -> None:
    assert [unit.page for unit in OURS if unit not in PINS]
    assert PINS


@each("unit", UNITS, ids=lambda unit: unit.page)
def test_every_entry_is_emulated_or_known_not_to_be(unit: Unit) -> None:
    assert unit.service.keys() <= EMULATED | NOT_EMULATED, unit.page


@each("unit", OURS, ids=lambda unit: unit.page)
def test_a_unit_has_a_user_without_rights_and_is_found_without_a_path(unit: Unit) -> None:
    assert unit.service["User"] not in ("root", "0")
    assert unit.service["NoNewPrivileges"] == "yes"
    assert unit.service["ProtectSystem"] in ("full", "strict")
    assert unit.command[0].startswith("/")  # systemd searches no PATH of a user's


@each("unit", PINS, ids=lambda unit: unit.page)
def test_the_unit_of_the_pins_has_a_folder_that_it_can_write_to(unit: Unit) -> None:
    assert unit.folder in unit.writable  # lgpio makes a pipe there
    words = unit.command
    for word in words[1:]:
        assert not word.startswith(("~", "./")), word
    listen = words[words.index("--listen") + 1].removeprefix("unix:")
    assert str(Path(listen).parent) in unit.writable


@each("unit", PINS, ids=lambda unit: unit.page)
def test_lgpio_has_a_folder_for_its_pipe(unit: Unit) -> None:
    """Without a home, in a folder of its own and in the root, as a user without rights."""
    user = NOBODY if os.getuid() == 0 else 0
    with TemporaryDirectory(prefix="wheelwire-unit-") as runtime:
        if user:
            os.chown(runtime, user, user)
        environment = unit.environment | {
            "WHEELWIRE_RUNTIME_DIR": runtime,
            "PYTHONPATH": os.pathsep.join(sys.path),
        }
        for folder in ("/", runtime):
            result = captured(sys.executable, "-c", PROGRAM, str(user), folder, env=environment)
            assert result.returncode == 0, result.stderr
            assert json.loads(result.stdout) == [runtime, folder]


def test_a_folder_that_is_named_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gpiozero.LGPIO_FOLDER, "/elsewhere")
    monkeypatch.setattr(os, "access", lambda *_: False)
    gpiozero._give_lgpio_a_folder()
    assert os.environ[gpiozero.LGPIO_FOLDER] == "/elsewhere"


def test_a_folder_that_can_be_written_to_needs_no_other(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv(gpiozero.LGPIO_FOLDER, raising=False)
    monkeypatch.chdir(tmp_path)
    gpiozero._give_lgpio_a_folder()
    assert gpiozero.LGPIO_FOLDER not in os.environ


@each(
    ("writable", "chips", "said"),
    [
        (False, ["gpiochip0"], "WorkingDirectory"),
        (True, [], "Raspberry Pi"),
        (True, ["gpiochip0"], "group gpio"),
    ],
)
def test_each_reason_is_named_as_itself(
    writable: bool, chips: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "glob", lambda *_: [tmp_path / name for name in chips])
    monkeypatch.setattr(
        os, "access", lambda path, *_: writable and not str(path).endswith("gpiochip0")
    )
    monkeypatch.setenv(gpiozero.LGPIO_FOLDER, str(tmp_path))
    assert said in gpiozero._why_no_gpio(OSError("can not open gpiochip"))
