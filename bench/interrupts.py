"""Signals at random moments, to a program that uses a robot.

{COUNT} of each.
"""

from __future__ import annotations

from harness import Report, run
from support.interrupts import interrupt_program

COUNT = 10_000
SEED = 7
HANDLERS = {"raise": "raises KeyboardInterrupt", "stop": "calls stop()"}


def main(report: Report) -> None:
    """Print the results; no signal may do any harm."""
    rows = []
    for mode, what in HANDLERS.items():
        result = interrupt_program(COUNT, mode, SEED)
        of = result.report
        failed, unsent = sum(of["errors"].values()), len(result.unsent)
        rows.append(f"{what} | {of['interrupts']} | {failed} | {unsent} | {of['longest_s']:.3f}")
        report.equal(f"unsent: {what}", unsent, 0)
        # The threads of the link and of its tap survived the signals, and ended with the driver.
        kept = (of["alive"], of["left"])
        report.target(f"threads during and after: {what}", kept, (2, 0), kept == (2, 0))
    report.table("the handler | signals | calls failed | succeeded unsent | longest call, s", rows)


run(main)
