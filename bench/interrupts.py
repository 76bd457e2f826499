"""Sends 10 000 signals at random moments to a program that uses a robot: `make reliability`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.interrupts import interrupt_program

COUNT = 10_000
SEED = 7


def main() -> None:
    """Print the results; fail if a signal did any harm."""
    rows = []
    for mode, what in (("raise", "raises KeyboardInterrupt"), ("stop", "calls stop()")):
        result = interrupt_program(COUNT, mode, SEED)
        report = result.report
        failed = sum(report["errors"].values())
        rows.append(
            [
                what,
                str(report["interrupts"]),
                str(failed),
                str(len(result.unsent)),
                f"{report['longest_s']:.3f}",
            ]
        )
        assert not result.unsent, result.unsent
        # The threads of the link and of its tap survived the signals, and ended with the driver.
        assert (report["alive"], report["left"]) == (2, 0), report
    head = ["the handler", "signals", "calls failed", "succeeded unsent", "longest call, s"]
    sys.stdout.write(table(head, rows) + "\n")


if __name__ == "__main__":
    main()
