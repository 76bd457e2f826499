"""Cost of the firmware's core on RV32IMC at -Os, compared with the last release: `make bench`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support import rv32, rv32_baseline
from support.benchmark import output_folder, table

WORK = {
    "step": "control step while driving",
    "step_with_setpoint": "... that takes a setpoint",
    "step_with_state": "... that sends a state",
    "step_with_both": "... that does both",
    "receive_setpoint": "receive and decode SetWheelVelocity",
    "send_state": "encode and send WheelState",
    "code_bytes": "bytes of code and constants",
    "ram_bytes": "bytes of RAM without the stack",
}
TARGETS = {
    "step_with_both, max": rv32.AIM_INSTRUCTIONS,
    "code_bytes": rv32.AIM_CODE_BYTES,
    "ram_bytes": rv32.AIM_RAM_BYTES,
}

METHOD = f"""\
Instructions retired on an ESP32-C6's instruction set, counted by QEMU's machine: the same at every
run, whatever else the computer does. Four seconds of driving, the setpoint every 17 steps, a state
every 10. A growth of {100 * rv32_baseline.GROWTH_LIMIT:g} % or more in any row fails a test.
"""


def row(figure: str, now: int, before: int | None) -> list[str]:
    """One figure, its previous value and its limit."""
    work, _, kind = figure.partition(", ")
    was = ["-", "-"] if before is None else [str(before), f"{now / before - 1:+.1%}"]
    target = f"< {TARGETS[figure]}" if figure in TARGETS else ""
    return [f"{WORK[work]}, {kind}" if kind else WORK[work], str(now), *was, target]


def main() -> int:
    """Print the table; returns 1 if a figure grew too much."""
    output_folder(__doc__)
    sys.stdout.write("## The firmware's core on RV32\n\n")
    if not rv32.available():
        sys.stdout.write(f"Left out: needs {rv32.INSTALL}\n")
        return 0
    rv32.build()
    baseline, now = rv32_baseline.load(), rv32_baseline.figures(rv32.cost())
    rows = [row(name, figure, baseline.figures.get(name)) for name, figure in now.items()]
    compilers = f"GCC {rv32.compiler_version()} now, {baseline.compiler} then"
    sys.stdout.write(f"{METHOD}The baseline is {baseline.release}; {compilers}.\n\n")
    sys.stdout.write(table(("", "now", baseline.release, "change", "target"), rows))
    if baseline.compiler != rv32.compiler_version():
        # The growth may then be the compiler's.
        return 0
    return 1 if rv32_baseline.too_much(rv32_baseline.growth(now, baseline.figures)) else 0


if __name__ == "__main__":
    sys.exit(main())
