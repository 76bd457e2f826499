"""Unplugs at random moments of every call.

With each API.
"""

from __future__ import annotations

from harness import Report, run
from support.unplugs import in_parallel, with_asyncio, with_threads


def main(report: Report, *, unplugs: int = 10_000, seed: int = 1) -> None:
    """Print how the calls ended; each has to, and each unplug has to be reported."""
    for one in (with_threads, with_asyncio):
        found = in_parallel(one, unplugs, seed)
        ends = ", ".join(f"{count} {end}" for end, count in found.ends.most_common())
        report.say(f"{one.__name__}: {ends}; the longest call took {found.longest_s:.2f} s")
        for what, lines in (("not bounded", found.unbounded), ("not reported", found.unheard)):
            report.say("\n".join(f"- {line}" for line in lines))
            report.equal(f"{one.__name__}: {what}", len(lines), 0)


run(main, log_level="CRITICAL")
