"""Endurance on a bad line, in real time: `make soak MINUTES=...`."""

from __future__ import annotations

import argparse
import json
import logging
import statistics
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, table_of_targets
from support.soak import CORRUPT, STATE_HZ, Lap, run
from wheelwire.link.info import quantile

GROWTH_KIB = 4096
"""Largest growth of the memory from the second to the last third that counts as none."""


def growth_kib(laps: list[Lap], process: int) -> int:
    """Growth of the memory from the second third of the run to the last, by medians."""
    # The first third is left out: buffers and caches still fill up then.
    third = max(1, len(laps) // 3)
    resident = [lap.resident_kib[process] for lap in laps]
    return round(statistics.median(resident[-third:]) - statistics.median(resident[third:-third]))


def rows(laps: list[Lap]) -> list[Target]:
    """What was measured in a run."""
    uncounted = sum(abs(number) for lap in laps for number in lap.uncounted)
    ticks = sum(abs(lap.ticks_wrong) for lap in laps)
    sessions = sum(lap.sessions for lap in laps)
    resets = sum(lap.incident == "reset" for lap in laps)
    found = [
        Target("frames given to the line", str(sum(lap.frames for lap in laps)), "", True),
        Target("... lost or damaged there", str(sum(lap.hit for lap in laps)), "", True),
        Target("... of which are in no counter", str(uncounted), "0", uncounted == 0),
        Target("ticks lost or invented", str(ticks), "0", ticks == 0),
        Target("sessions lost without an incident", str(sessions), "0", sessions == 0),
        # Each lap has the sum so far.
        Target("setpoints that came too late", str(laps[-1].expired), "", True),
        Target("resets, unpluggings", f"{resets}, {len(laps) - resets}", "", True),
    ]
    for incident in ("reset", "unplug"):
        times = [lap.recovery_s for lap in laps if lap.incident == incident]
        value = f"p50 {quantile(times, 0.5):.3f} s, max {max(times, default=0):.3f} s"
        found.append(Target(f"recovered from {incident}", value, "", True))
    for process, name in enumerate(("host", "simulator")):
        grown = growth_kib(laps, process)
        reached = grown < GROWTH_KIB
        limit = f"< {GROWTH_KIB} KiB"
        found.append(Target(f"growth of the {name}", f"{grown} KiB", limit, reached))
    for name in ("threads", "files"):
        counts = {getattr(lap, name) for lap in laps}
        numbers = str(sorted(counts))
        found.append(Target(f"{name} of the host", numbers, "one number", len(counts) == 1))
    return found


def main() -> int:
    """Run, print, and fail if a target is missed."""
    logging.getLogger("wheelwire").setLevel(logging.ERROR)  # each loss is meant
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--log", type=Path, help="a line of JSON for each lap")
    arguments = parser.parse_args()
    laps = run(arguments.minutes, lambda lap: _log(lap, arguments.log))
    title = f"{arguments.minutes:g} min at {STATE_HZ} Hz, {CORRUPT:.0%} of all bytes corrupted"
    found = rows(laps)
    sys.stdout.write(f"{title}\n\n{table_of_targets(found)}")
    return 0 if all(target.reached for target in found) else 1


def _log(lap: Lap, path: Path | None) -> None:
    if path is not None:
        with path.open("a") as file:
            file.write(json.dumps(asdict(lap)) + "\n")


if __name__ == "__main__":
    sys.exit(main())
