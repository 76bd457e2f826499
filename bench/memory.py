"""How much memory the ROS node takes over time: a curve, as rows of minutes and kilobytes.

`.venv/bin/python bench/memory.py 240` for four hours. The node drives a simulated robot, commanded
20 times a second, at its default rates.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.ros import Repeater
from support.ros_rig import open_rig, twist

PERIOD_S = 60.0
MINUTES = 10.0


def private_kb(pid: int) -> int:
    """What the process alone has written to."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text("ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Private_Dirty:"))


def main() -> None:
    """Print the curve."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else MINUTES
    with TemporaryDirectory() as folder, open_rig(Path(folder)) as rig:
        pid = rig.node.process.pid
        begin_s = time.monotonic()
        with Repeater(rig.commands, lambda: twist(0.1, 0.3), 20.0):
            while (now_s := time.monotonic() - begin_s) <= minutes * 60:
                sys.stdout.write(f"{now_s / 60:.0f} min {private_kb(pid)} kB\n")
                sys.stdout.flush()
                time.sleep(PERIOD_S)


if __name__ == "__main__":
    main()
