"""Accuracy of the clock estimate and reliability of its error bound, over drifts and delays.

`make reliability`
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.clocks import LONG_DELAYS, SHORT_DELAYS, USB, Clocks, Coverage, LineDelays, session
from wheelwire.link.info import quantile

TARGET = 0.999
SESSIONS = 50
DRIFTS_PPM = (-200, -50, 0, 50, 200)
STEP_US = 100_000
STEPS = 4


def measure(drift_ppm: float, ways: LineDelays, steps: int = 0) -> Coverage:
    """The results of `SESSIONS` sessions."""
    coverage = Coverage()
    for seed in range(SESSIONS):
        clocks = Clocks(seed, drift_ppm * 1e-6, ways)
        session(coverage, clocks, step_us=STEP_US if steps else 0, steps=steps)
    return coverage


def main() -> int:
    """Print the table; fail if a bound is too often exceeded."""
    cases = {f"{drift:+d} ppm, as on USB": measure(drift, USB) for drift in DRIFTS_PPM}
    cases["+200 ppm, a calm line"] = measure(200, SHORT_DELAYS)
    cases["+200 ppm, delays of 50 ms"] = measure(200, LONG_DELAYS)
    cases[f"+50 ppm, {STEPS} steps of {STEP_US / 1e3:g} ms"] = measure(50, USB, STEPS)
    header = ("case", "samples", "within the bound", "error p50", "p99", "bound p50")
    sys.stdout.write(table(header, [_row(*case) for case in cases.items()]))
    return int(min(found.share for found in cases.values()) < TARGET)


def _row(name: str, found: Coverage) -> list[str]:
    microseconds = (
        quantile(found.errors_us, 0.5),
        quantile(found.errors_us, 0.99),
        quantile(found.bounds_us, 0.5),
    )
    numbers = [f"{number:.0f} us" for number in microseconds]
    return [name, str(found.checked), f"{found.share:.3%}", *numbers]


if __name__ == "__main__":
    sys.exit(main())
