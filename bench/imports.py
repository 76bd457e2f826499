"""Imports.

In ms, in fresh processes with a warm page cache, medians of {ROUNDS} interleaved rounds, less the
time of `python -c pass`.
"""

from __future__ import annotations

from harness import Report, run
from support.benchmark import import_ms

ROUNDS = 15
AIM_MS = 60
MODULES = {
    "wheelwire": "what every program does first",
    "wheelwire_protocol.framing": "messages and frames",
    "wheelwire.drivers.serial": "the driver, as `open_driver` imports it",
    "wheelwire_protocol.bulk": "captures; numpy",
    "wheelwire.cli.app": "the command; typer",
}


def main(report: Report) -> None:
    """Print the list."""
    times = import_ms(MODULES, ROUNDS)
    rows = [f"`import {name}`, {what} | {times[name]:.0f}" for name, what in MODULES.items()]
    report.items([f"`python -c pass`, for comparison | {times['']:.0f}", *rows])
    for name in ("wheelwire", "wheelwire.drivers.serial"):
        report.at_most(f"`import {name}`", times[name], AIM_MS, " ms")


run(main)
