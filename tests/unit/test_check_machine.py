"""tools/check-machine says in one line what a machine lacks."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from support.processes import captured

PROGRAM = Path(__file__).parents[2] / "tools" / "check-machine"
GOOD = "exit 0"
OLD = 'case "$1" in -V) echo Python 3.8.2;; *) exit 1;; esac'
NO_VENV = 'case "$2" in *venv*) exit 1;; esac'


@pytest.mark.parametrize(
    ("python", "compiler", "lacks", "packages"),
    [
        (GOOD, GOOD, None, ""),
        (None, GOOD, "Python 3.10 or later (python3 was not found)", "python3 python3-venv"),
        (OLD, GOOD, "Python 3.8.2 is older", "python3 python3-venv"),
        (NO_VENV, GOOD, "Python's venv module", "python3-venv"),
        (GOOD, None, "a C++ compiler (c++ was not found)", "g++"),
        (GOOD, "exit 1", "a C++20 compiler", "g++"),
        (NO_VENV, None, "Python's venv module; a C++ compiler", "python3-venv g++"),
    ],
)
def test_one_line_names_the_packages(
    tmp_path: Path, python: str | None, compiler: str | None, lacks: str | None, packages: str
) -> None:
    for name, script in {"python3": python, "c++": compiler}.items():
        if script is not None:
            (tmp_path / name).write_text(f"#!{shutil.which('sh')}\n{script}\n")
            (tmp_path / name).chmod(0o755)
    result = captured(shutil.which("sh") or "sh", PROGRAM, env={"PATH": str(tmp_path)})
    if lacks is None:
        assert (result.returncode, result.stderr) == (0, "")
        return
    (line,) = result.stderr.splitlines()
    assert result.returncode == 1
    assert lacks in line
    assert line.endswith(f"sudo apt install {packages}")
