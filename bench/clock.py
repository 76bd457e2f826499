"""The clock's estimate, and its bound.

Drifts and delays of the line; of {SESSIONS} sessions each.
"""

from __future__ import annotations

from harness import Report, run
from support.clocks import LONG_DELAYS, SHORT_DELAYS, USB, Clocks, Coverage, LineDelays, session
from wheelwire.link.statistics import quantile

TARGET = 0.999
SESSIONS = 50
DRIFTS_PPM = (-200, -50, 0, 50, 200)
STEP_US = 100_000
STEPS = 4


def measure(drift_ppm: float, ways: LineDelays, steps: int = 0) -> Coverage:
    """The results of all sessions."""
    coverage = Coverage()
    for seed in range(SESSIONS):
        clocks = Clocks(seed, drift_ppm * 1e-6, ways)
        session(coverage, clocks, step_us=STEP_US if steps else 0, steps=steps)
    return coverage


def main(report: Report) -> None:
    """Print the table; a bound must not be exceeded too often."""
    cases = {f"{drift:+d} ppm, as on USB": measure(drift, USB) for drift in DRIFTS_PPM}
    cases["+200 ppm, a calm line"] = measure(200, SHORT_DELAYS)
    cases["+200 ppm, delays of 50 ms"] = measure(200, LONG_DELAYS)
    cases[f"+50 ppm, {STEPS} steps of {STEP_US / 1e3:g} ms"] = measure(50, USB, STEPS)
    rows = [
        f"{name} | {len(found.errors_us)} | {found.share:.3%} | "
        f"{quantile(found.errors_us, 0.5):.0f} us | {quantile(found.errors_us, 0.99):.0f} us | "
        f"{quantile(found.bounds_us, 0.5):.0f} us"
        for name, found in cases.items()
    ]
    report.table("case | samples | within the bound | error p50 | p99 | bound p50", rows)
    least = min(found.share for found in cases.values())
    report.at_least("within the bound", least, TARGET, ".3%")


run(main)
