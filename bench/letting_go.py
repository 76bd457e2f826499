"""From the hand's last action to standstill.

In virtual time.
"""

from __future__ import annotations

from harness import Report, run
from support.hand import LETTING_GO, stop_after
from wheelwire.tools.teleop.drive import SPEEDS

FULL_MPS = 0.4
"""The parameter max_velocity_mps by default."""


def main(report: Report) -> None:
    """Print the table."""
    speeds = (2, 5, SPEEDS)
    rows = []
    for name, action in LETTING_GO.items():
        stops = [stop_after(action, speed) for speed in speeds]
        cells = [f"{stop.seconds:.2f} s, {stop.metres:.3f} m" for stop in stops]
        rows.append(" | ".join([name, *cells]))
    heads = [f"at {FULL_MPS * speed / SPEEDS:.2f} m/s" for speed in speeds]
    report.table(" | ".join(["last action", *heads]), rows)


run(main)
