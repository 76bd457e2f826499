"""Another program is named by its command line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.cases import each
from support.waiting import wait_until
from wheelwire.link.program_names import LONGEST, process_name, program_name


@each(
    ("words", "expected"),
    [
        (["/usr/bin/python3", "follow_line.py"], "python3 follow_line.py"),
        (
            ["python3", "/home/someone/robot/follow_line.py", "--fast"],
            "python3 follow_line.py --fast",
        ),
        (
            ["/usr/bin/python3", "/opt/bin/wheelwire", "monitor", "/dev/ttyUSB0"],
            "wheelwire monitor /dev/ttyUSB0",
        ),
        (["python3", "-m", "wheelwire", "monitor"], "wheelwire monitor"),
        (["python3"], "python3"),
        (["python3", "-c", "a = 1\nb = 2"], "python3 -c 'a = 1?b = 2'"),
        (["screen", "/home/someone/my port"], "screen 'my port'"),
    ],
)
def test_each_command_line(words: list[str], expected: str, tmp_path: Path) -> None:
    process = tmp_path / "4711"
    process.mkdir(exist_ok=True)
    (process / "cmdline").write_bytes("\0".join([*words, ""]).encode())
    assert program_name(4711, tmp_path) == expected


def test_it_is_short_and_never_raises(tmp_path: Path) -> None:
    process = tmp_path / "1"
    process.mkdir()
    (process / "cmdline").write_bytes(b"x\0" + b"\xff" * 500)
    assert len(program_name(1, tmp_path)) <= LONGEST + 3
    (process / "cmdline").write_bytes(b"")  # of the kernel, or a zombie
    assert program_name(1, tmp_path) == "a program"
    (process / "comm").write_text("kworker\n")
    assert program_name(1, tmp_path) == "kworker"
    assert program_name(2, tmp_path) == "a program"


@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="needs /proc")
def test_of_a_process_that_runs(tmp_path: Path) -> None:
    script = tmp_path / "follow_line.py"
    script.write_text("input()\n")
    with subprocess.Popen([sys.executable, str(script)], stdin=subprocess.PIPE) as process:
        name = f"follow_line.py, process {process.pid}"
        wait_until(lambda: process_name(process.pid).endswith(name))
        process.communicate(b"\n")
    assert process_name(os.getpid()).endswith(f", process {os.getpid()}")
