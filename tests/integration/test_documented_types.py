"""A type checker accepts what the pages and examples do, and finds a misspelt option."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from textwrap import indent

import pytest

from support.pages import PAGES, ROOT, Block, blocks

pytestmark = pytest.mark.whole

PRELUDE = """\
import asyncio, logging, math, threading, time
from typing import Any
import wheelwire
from wheelwire import aio
horn: Any  # of the reader
drives_well: Any
"""
"""Before each block, which may be a part of a program that has begun further up on its page."""


def checked(tmp_path: Path, programs: dict[str, str]) -> list[str]:
    """What mypy says of programs by name, a line each."""
    for name, text in programs.items():
        (tmp_path / f"{name}.py").write_text(text, "utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml")]
    files = [str(tmp_path / f"{name}.py") for name in programs]
    done: subprocess.CompletedProcess[str] = subprocess.run(
        [*command, "--no-error-summary", *files],
        cwd=ROOT,
        env={**os.environ, "MYPYPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert not done.stderr, done.stderr
    return done.stdout.splitlines()


def as_program(block: Block) -> str:
    """A block as a file of its own: what it has from further up on its page is declared."""
    body = block.text
    names = set(re.findall(r"\b(robot|sample|odometry)\b", body))
    bound = set(
        re.findall(r"(?:\bas |\bfor |^ *)(robot|sample|odometry)(?= =|:| in )", body, re.MULTILINE)
    )
    is_async = bool(re.search(r"^ *(await|async (with|for))\b|= await ", body, re.MULTILINE))
    is_whole = "async def" in body
    kind = "aio.Driver" if is_async and not is_whole else "wheelwire.Robot"
    types = {"robot": kind, "sample": "wheelwire.WheelSample", "odometry": "wheelwire.Odometry"}
    given = [f"{name}: {types[name]}" for name in sorted(names - bound)]
    if is_async and not is_whole:
        body = f"async def program({', '.join(given)}) -> None:\n{indent(body, '    ')}"
        given = []
    return "\n".join([PRELUDE, *given, body])


def test_the_programs_of_the_pages(tmp_path: Path) -> None:
    found = [block for page in PAGES for block in blocks(page) if block.language == "python"]
    names = {re.sub(r"\W", "_", block.place): block for block in found}
    (driver,) = (block.text for block in found if "class MyDriver" in block.text)
    (tmp_path / "my_package").mkdir()
    (tmp_path / "my_package" / "driver.py").write_text(driver, "utf-8")
    said = checked(tmp_path, {name: as_program(block) for name, block in names.items()})
    assert not said, "\n".join(said)


CALLS = """
wheelwire.open_driver("serial", "/dev/ttyUSB0", baud_rate=115_200, record="day.mcap").info
wheelwire.open_driver("l298n", pwm_chip=0, record="day.mcap").limits
wheelwire.open_driver("pigpio", "localhost", 8888, record="day.mcap").limits
wheelwire.open_driver("mock", realtime=False, record="day.mcap").simulator
wheelwire.open_driver("replay", file="day.mcap", speed=2.0, record="day.mcap").comparison
options: dict[str, Any] = {}
wheelwire.open_driver(input(), **options).contradictions()
wheelwire.connect().watch_stops(print)
"""


MISSPELT = """
wheelwire.open_driver("serial", "/dev/ttyUSB0", baudrate=115_200)
wheelwire.open_driver("l298n", pwm_chips=0)
wheelwire.open_driver("pigpio", hosts="localhost")
wheelwire.open_driver("mock", real_time=False)
wheelwire.open_driver("replay", file="day.mcap", sped=2.0)
aio.open_driver("serial", "/dev/ttyUSB0", baudrate=115_200)
wheelwire.connect().set_velocty(0.1, 0.0)
""".strip().splitlines()


def test_the_options_and_verbs_of_each_driver_are_known_and_a_misspelt_one_is_an_error(
    tmp_path: Path,
) -> None:
    programs = {"right": CALLS, "wrong": "\n".join(MISSPELT)}
    said = checked(tmp_path, {name: PRELUDE + text for name, text in programs.items()})
    first = PRELUDE.count("\n") + 1
    errors = {tuple(line.split(":")[:2]) for line in said if ": error: " in line}
    wrong = str(tmp_path / "wrong.py")
    assert errors == {(wrong, str(first + number)) for number in range(len(MISSPELT))}, said
