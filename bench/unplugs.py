"""Unplugs at random moments of every call of both APIs: `make reliability`."""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support import unplugs


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--unplugs", type=int, default=10_000, help="with each API")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    # Each unplug is a warning of the link's.
    logging.getLogger("wheelwire").setLevel(logging.CRITICAL)
    failed = False
    for run in (unplugs.with_threads, unplugs.with_asyncio):
        outcome = unplugs.in_parallel(run, arguments.unplugs, arguments.seed)
        ends = ", ".join(f"{count} {end}" for end, count in outcome.ends.most_common())
        longest = f"the longest call took {outcome.longest_s:.2f} s"
        lines = [f"{run.__name__}: {ends}; {longest}"]
        lines += [f"  not bounded: {line}" for line in outcome.unbounded]
        lines += [f"  not reported: {line}" for line in outcome.unheard]
        sys.stdout.write("\n".join([*lines, ""]))
        failed = failed or bool(outcome.unbounded or outcome.unheard)
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
