"""The firmware's core on RV32.

Instructions on an ESP32-C6's instruction set, counted by QEMU, in four seconds of driving with a
setpoint every 17 steps and a state every 10: median and maximum, each with its growth since the
last release. Growth of {GROWTH_PERCENT:g} % fails a test.
"""

from __future__ import annotations

from harness import Report, run
from support import rv32, rv32_baseline

GROWTH_PERCENT = 100 * rv32_baseline.GROWTH_LIMIT
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
LIMITS = {
    "step_with_both, max": rv32.AIM_INSTRUCTIONS,
    "code_bytes": rv32.AIM_CODE_BYTES,
    "ram_bytes": rv32.AIM_RAM_BYTES,
}


def main(report: Report) -> None:
    """Print the table; no figure may grow too much."""
    if not rv32.available():
        report.say(f"Left out: needs {rv32.INSTALL}")
        return
    rv32.build()
    baseline, now = rv32_baseline.load(), rv32_baseline.figures(rv32.cost())
    compiler = rv32.compiler_version()
    report.say(f"The baseline is {baseline.release}; GCC {compiler} now, {baseline.compiler} then.")
    cells: dict[str, list[str]] = {}
    for name, figure in now.items():
        # Not of sizes: the baseline's are of the core without sensors, and these have limits.
        before = None if name.endswith("_bytes") else baseline.figures.get(name)
        grown_by = [] if before is None else [f"{figure / before - 1:+.1%}"]
        limit = [f"limit {LIMITS[name]}"] if name in LIMITS else []
        remark = ", ".join([*grown_by, *limit])
        of = cells.setdefault(name.partition(", ")[0], [])
        of.append(f"{figure} ({remark})" if remark else f"{figure}")
    report.items(" | ".join([WORK[work], *of]) for work, of in cells.items())
    if baseline.compiler == compiler:  # else the growth may be the compiler's
        grown = rv32_baseline.too_much(rv32_baseline.growth(now, baseline.figures))
        report.equal(f"figures that grew by {GROWTH_PERCENT:g} % or more", len(grown), 0)


run(main)
