"""Import times in a fresh interpreter: `make bench`, or this file alone."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import import_ms, output_folder, table

ROUNDS = 15
AIM_MS = 60

METHOD = f"""\
In fresh processes, the modules' compiled files in the page cache, medians of {ROUNDS} interleaved
rounds. What `python -c pass` takes in the same round is taken off.
"""
MODULES = {
    "wheelwire": "what every program does first",
    "wheelwire_protocol.framing": "messages and frames",
    "wheelwire.drivers.serial": "the driver, as `open_driver` imports it",
    "wheelwire_protocol.bulk": "captures; numpy",
    "wheelwire.cli.app": "the command; typer",
}


def main() -> int:
    """Print the table; returns 1 if the target is missed."""
    output_folder(__doc__)
    times = import_ms(MODULES, ROUNDS)
    rows = [["`python -c pass`, for comparison", f"{times['']:.0f}", ""]]
    rows += [
        [f"`import {module}`: {what}", f"{times[module]:.0f}", ""]
        for module, what in MODULES.items()
    ]
    # Only what every program imports has a target.
    rows[1][-1] = f"< {AIM_MS}"
    header = ("", "time [ms]", "target")
    sys.stdout.write(f"## Imports\n\n{METHOD}\n{table(header, rows)}")
    return 0 if times["wheelwire"] < AIM_MS else 1


if __name__ == "__main__":
    sys.exit(main())
