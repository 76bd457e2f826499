"""The measurements of `make hil` on the simulated board: `make hil PORT=sim [LONG=1] [FAULT=name]`.

It has the wires of LOOP=25:18,26:19, whether they are named or not.

Ends with 1 if a row fails. A fault is a mutation of tests/mutants/hil.toml, tried in a private copy
of the checkout; its name begins with the row that has to notice it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1]))
from support import hil
from support.mutants import DATA, ROOT, Mutant, MutantError, Workspace, alone, load

CONSOLE = Console(markup=False, highlight=False, soft_wrap=True)
PROGRAM = "wheelwire-hil-sim"
FAULTS = DATA / "hil.toml"
BUILD = ROOT / "build" / "hil"
TIMES_LONG = 10
WIRES = "25:18,26:19"


def fault_named(name: str) -> Mutant:
    """The fault to plant. Raises MutantError if there is none of this name."""
    faults = {mutant.name: mutant for mutant in load(FAULTS).mutants}
    if name not in faults:
        raise MutantError(f"no fault is called {name}; there are {', '.join(faults)}")
    return faults[name]


def measure_with(fault: Mutant, times: int) -> hil.Measured:
    """Plant a fault in a copy of the checkout, build that, and measure."""
    with alone(BUILD):
        workspace = Workspace(BUILD / "checkout")
        with workspace.planted(fault):
            if complaints := workspace.build([PROGRAM]):
                raise MutantError(complaints[-2000:])
            return hil.simulate(workspace.folder / "build" / "host" / PROGRAM, times)


def main() -> int:
    """Measure, print the table, write the measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--long", action="store_true", help="ten times as often")
    parser.add_argument("--fault", help="plant this fault; its row has to fail")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "hil.json")
    parser.add_argument("--loop", default=WIRES, help=f"its wires, {WIRES}; it has no others")
    options = parser.parse_args()
    if options.loop != WIRES:
        CONSOLE.print(f"make hil: the simulated board has the wires LOOP={WIRES}")
        return 2
    times = TIMES_LONG if options.long else 1
    try:
        if options.fault:
            measured = measure_with(fault_named(options.fault), times)
        else:
            measured = hil.simulate(ROOT / "build" / "host" / PROGRAM, times)
    except MutantError as error:
        CONSOLE.print(f"make hil: {error}")
        return 2
    return 0 if hil.report(measured, options.output, CONSOLE.print) else 1


if __name__ == "__main__":
    sys.exit(main())
