"""What `make` without a target lists, and what `make demo` installs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]


def make(*arguments: str) -> str:
    command = ["make", "--no-print-directory", "-C", str(ROOT), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def targets(text: str) -> list[str]:
    return re.findall(r"^  make (\S+)", text, re.M)


def test_help_lists_five_targets_and_names_the_list_of_all() -> None:
    short, everything = make(), make("help-all")
    assert targets(short) == ["demo", "lint", "docs", "test", "test-all"]
    assert "make help-all" in short
    assert set(targets(short)) < set(targets(everything))


def test_each_target_that_others_may_run_is_listed() -> None:
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.M)
    assert phony is not None
    inner = {"help", "compiled", "explorer", "prepared", "ros-if-available"}
    assert set(targets(make("help-all"))) == set(phony[1].split()) - inner


def test_the_demonstration_installs_no_tools_of_development() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert {re.split("[>=]", one)[0] for one in extras["build"]} == {"cmake", "ninja"}
    installs = [
        line for line in make("-n", "VENV=build/none", "demo").splitlines() if "pip" in line
    ]
    assert [re.findall(r"'\.\[(.*)\]'", line) for line in installs] == [["build"]]


def test_each_long_step_of_the_demonstration_is_announced_with_how_long_it_takes() -> None:
    lines = make("-n", "UV=", "VENV=build/none", "HOST_BUILD=build/none", "demo").splitlines()
    steps = ("-m venv", "-m pip install", "cmake --build")
    for step, says in zip(steps, ("seconds", "half a minute, 200 MB", "a minute"), strict=True):
        at = next(number for number, line in enumerate(lines) if step in line)
        said = [line for line in lines[:at] if "echo" in line]
        assert says in said[-1], step
        assert "once" in said[-1], step


def test_after_the_tools_of_development_the_demonstration_installs_nothing(tmp_path: Path) -> None:
    # As if `make test` had come first.
    (tmp_path / "made").touch()
    (tmp_path / "installed").touch()
    (tmp_path / "sim-installed").touch()
    assert "pip" not in make("-n", f"VENV={tmp_path}", "demo")
    (tmp_path / "installed").unlink()
    assert "'.[dev]'" in make("-n", f"VENV={tmp_path}", "lint")


def test_all_tests_are_those_of_make_test_and_the_others() -> None:
    chosen = re.findall(r' -m "([^"]+)"', make("-n", "test-all", "ONLY=tests"))
    assert chosen == ["whole or hypothesis", "not whole"]
    # Which files pytest need not import, the configuration says for each of the two.
    configuration = (ROOT / "tests" / "conftest.py").read_text("utf-8")
    assert [words for words in chosen if f'"{words}"' not in configuration] == []
    assert ' -m "' not in make("-n", "test-all", "ONLY=tests/unit/link")
