"""`python -m wheelwire_protocol.generate [--check]`: writes all derived files, or compares them.

Nothing here imports `types` or modules that need it, so that a message can be added or removed
while `types.py` still has the old ones.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from . import (
    board_tables,
    c_abi,
    cpp,
    cpp_names,
    cpp_vectors,
    markdown,
    python,
    sensor_tables,
    typescript,
    vectors,
)

CHECKOUT = Path(__file__).parents[3]
FIRMWARE = Path("firmware/esp32")
HANDMADE = Path("protocol/vectors/handmade.json")


def _clang_format(root: Path, text: str) -> str:
    beside_python = str(Path(sys.executable).parent)
    path = os.pathsep.join([beside_python, os.environ.get("PATH", os.defpath)])
    executable = shutil.which("clang-format", path=path)
    if executable is None:
        sys.exit("clang-format is missing; `pip install clang-format` brings it")
    style = f"--style=file:{root / '.clang-format'}"
    return _filtered([executable, style, "--assume-filename=generated.hpp"], text)


def _ruff_format(text: str) -> str:
    options = ["--isolated", "--line-length=100"]
    return _filtered([sys.executable, "-m", "ruff", "format", *options, "-"], text)


def _filtered(command: list[str], text: str) -> str:
    return subprocess.run(command, input=text, capture_output=True, check=True, text=True).stdout


def outputs(root: Path) -> dict[Path, str]:
    """Path, relative to the checkout at `root`, and right text of each derived file."""
    generated = vectors.generate()
    handmade = (root / HANDMADE).read_text("utf-8")
    core = root / FIRMWARE / "capi" / "wheelwire_core.h"
    simulator = root / FIRMWARE / "sim" / "libfwsim.h"
    modules = {
        "protocol/wheelwire_protocol/types.py": python.generate(),
        "tests/support/self_test_types.py": python.generate_self_test(),
        "protocol/wheelwire_protocol/core_abi.py": c_abi.generate(core, "wheelwire"),
        "host/wheelwire/simulation/fwsim_abi.py": c_abi.generate(simulator, "fwsim"),
    }
    headers = {
        "core/protocol.hpp": cpp.generate(),
        "main/self_test_protocol.hpp": cpp.generate_self_test(),
        "core/board_tables.hpp": board_tables.generate(),
        "core/sensor_tables.hpp": sensor_tables.generate(),
        "explore/protocol_names.hpp": cpp_names.generate(),
        "test/vectors.hpp": cpp_vectors.generate(handmade, generated),
    }
    return {
        **{Path(name): _ruff_format(text) for name, text in modules.items()},
        **{FIRMWARE / name: _clang_format(root, text) for name, text in headers.items()},
        Path("protocol/MESSAGES.md"): markdown.generate(),
        Path("web/src/generated/protocol.ts"): typescript.generate(),
        Path("protocol/vectors/generated.json"): generated,
    }


def stale(root: Path) -> dict[Path, str]:
    """The `outputs` whose file is missing or differs."""
    return {
        path: text
        for path, text in outputs(root).items()
        if not (root / path).exists() or (root / path).read_text("utf-8") != text
    }


def main(arguments: list[str] | None = None) -> int:
    """Write the files that differ, or with --check name them. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m wheelwire_protocol.generate")
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit 1 on a difference"
    )
    parser.add_argument("--root", type=Path, default=CHECKOUT, help="the checkout to work on")
    options = parser.parse_args(arguments)
    differing = stale(options.root)
    for path, text in differing.items():
        if options.check:
            sys.stderr.write(f"{path} differs from the definitions; run make gen\n")
        else:
            (options.root / path).write_text(text, "utf-8")
            sys.stdout.write(f"{path} written\n")
    return 1 if options.check and differing else 0


if __name__ == "__main__":
    sys.exit(main())
