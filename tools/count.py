"""The size of the code, and what a program that drives a robot loads of it: `tools/count.py`.

A code line holds more than blanks, a comment or a docstring. What `make gen` writes counts apart,
and so does data. This prints and judges nothing.
"""

from __future__ import annotations

import ast
import io
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from statistics import median
from tokenize import COMMENT, DEDENT, ENCODING, ENDMARKER, INDENT, NEWLINE, NL, generate_tokens
from typing import NamedTuple

from generated import ROOT, table
from wheelwire.simulation.simulator import Simulator

# Which files a row counts, by how their paths begin.
ROWS = {
    "host + protocol": ("host/", "protocol/"),
    "node": ("ros_node/",),
    "bench + tools": ("bench/", "tools/"),
    "page": ("web/",),
    "core + sensors + recorder + rerun + main + capi": tuple(
        f"firmware/esp32/{folder}/"
        for folder in ("core", "sensors", "recorder", "rerun", "main", "capi")
    ),
    "sim + explore + fuzz + rv32": tuple(
        f"firmware/esp32/{folder}/" for folder in ("sim", "explore", "fuzz", "rv32")
    ),
    "tests": ("tests/", "firmware/esp32/test/"),
}
CODE = {".py", ".cpp", ".hpp", ".c", ".h", ".ts", ".js", ".mjs"}
DATA = {".json", ".yaml", ".yml", ".toml", ".csv", ".hex", ".txt", ".xml", ".map", ".urdf", ".msg"}
GENERATED = re.compile(rb"enerated by `?(?:make gen|tools/)")

# Strings are matched, too: what looks like a comment in a string is not a comment.
C_TOKENS = re.compile(
    r'//[^\n]*|/\*.*?\*/|R"\(.*?\)"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])\'', re.DOTALL
)
LAYOUT = {COMMENT, DEDENT, ENCODING, ENDMARKER, INDENT, NEWLINE, NL}

# Runs in a fresh process, with a port as its argument.
DRIVE = """
import json, os, sys, time
from wheelwire import connect

calls = []

def trace(frame, event, arg):
    if event == "c_call" and arg is os.write:
        sys.setprofile(None)
    elif event == "call":
        calls[-1].append(frame.f_code.co_filename)

with connect(sys.argv[1]) as robot:
    for number in range(1000):
        if number in (0, 999):
            calls.append([])
            sys.setprofile(trace)
        robot.set_velocity(0.1, 0.0)
        sys.setprofile(None)
        # A robot that does not keep up makes the port refuse setpoints: wait for a new sample.
        while number % 20 == 0 and time.monotonic() - robot.read(timeout=60.0).stamp > 0.2:
            pass
    robot.stop()
files = [m.__file__ for m in list(sys.modules.values()) if m.__name__.startswith("wheelwire")]
# A method that dataclasses wrote is in no file.
counts = [[len(c), len({name for name in c if os.path.isfile(name)})] for c in calls]
print(json.dumps({"files": files, "calls": counts}))
"""


class Count(NamedTuple):
    """Lines and bytes of some files."""

    code: int = 0
    generated: int = 0
    data: int = 0
    bytes: int = 0


def code_lines(text: str, suffix: str) -> int:
    """The lines of a source file that hold code."""
    if suffix == ".py":
        return len(_python_lines(text))
    without = C_TOKENS.sub(
        lambda m: m[0] if m[0][0] in "\"'R" else " " + "\n" * m[0].count("\n"), text
    )
    return sum(1 for line in without.splitlines() if line.strip())


def _python_lines(text: str) -> set[int]:
    lines: set[int] = set()
    for token in generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str):
            lines.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return {number for number, line in enumerate(text.splitlines(), 1) if line.strip()} & lines


def count(path: Path) -> Count:
    """Lines and bytes of one file; in a generated file, all of them are generated."""
    content = path.read_bytes()
    if GENERATED.search(content[:400]):
        return Count(generated=content.count(b"\n"), bytes=len(content))
    if path.suffix in CODE:
        return Count(code=code_lines(content.decode(), path.suffix), bytes=len(content))
    lines = content.count(b"\n") if path.suffix in DATA else 0
    return Count(data=lines, bytes=len(content))


def total(paths: Iterable[Path]) -> Count:
    """The sum over these files."""
    return Count(*map(sum, zip(Count(), *map(count, paths), strict=True)))


def tracked() -> list[Path]:
    """The repository's present files, including new ones that git does not ignore."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [path for name in names.splitlines() if (path := ROOT / name).is_file()]


def sizes(files: Iterable[Path]) -> Iterator[list[str]]:
    """A row for each part of the repository."""
    names = {path: str(path.relative_to(ROOT)) for path in files}
    for row, folders in ROWS.items():
        parts = [path for path, name in names.items() if name.startswith(folders)]
        if parts:
            yield [row, *(f"{number:,}" for number in total(parts))]
    yield ["the repository", *(f"{number:,}" for number in total(names))]


def modules(files: Iterable[Path]) -> list[int]:
    """The code lines of each module of host and protocol that has some."""
    folders = (ROOT / "host", ROOT / "protocol")
    ours = [f for f in files if f.suffix == ".py" and any(f.is_relative_to(at) for at in folders)]
    return [lines for path in ours if (lines := count(path).code)]


def driven() -> tuple[Counter[Path], list[list[int]]]:
    """What driving a simulated robot over a serial port loads, and the calls of `set_velocity`.

    Returns:
        The code lines of each of our modules that is loaded in the end, and for the first and the
        thousandth call how many Python calls precede the `write`, in how many files.
    """
    with Simulator() as simulator:
        command = [sys.executable, "-c", DRIVE, simulator.port]
        output = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    result = json.loads(output)
    paths = [Path(file) for file in result["files"] if file]
    return Counter({path: count(path).code for path in paths}), result["calls"]


def main() -> None:
    """Print the tables."""
    files = tracked()
    print(table(("", "code", "generated", "data", "bytes"), sizes(files)))
    lines = modules(files)
    loaded, calls = driven()
    rows = [
        [
            "loaded after connect, drive, read, stop, close",
            f"{len(loaded)} modules, {loaded.total()} lines",
        ],
        *(
            [f"`set_velocity` to `write`, {which} call", f"{made} calls, {within} files"]
            for which, (made, within) in zip(("first", "thousandth"), calls, strict=True)
        ),
        ["host + protocol: median, largest module", f"{median(lines):g}, {max(lines)} lines"],
    ]
    print(table(("a program", ""), rows))


if __name__ == "__main__":
    main()
