"""Time and distance from the hand's last action to standstill, in virtual time: docs/teleop.md."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.hand import LETTING_GO, stop_after
from wheelwire.tools.teleop.drive import SPEEDS

FULL_MPS = 0.4
"""The parameter max_velocity_mps by default."""


def main() -> None:
    """Print the table."""
    rows = []
    for name, action in LETTING_GO.items():
        for speed in (2, 5, SPEEDS):
            stop = stop_after(action, speed)
            row = [name, f"{FULL_MPS * speed / SPEEDS:.2f} m/s"]
            rows.append([*row, f"{stop.seconds:.2f} s", f"{stop.metres:.3f} m"])
    sys.stdout.write(table(("last action", "speed", "until standstill", "distance"), rows))


if __name__ == "__main__":
    main()
