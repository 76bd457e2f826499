"""CPU of links on one asyncio loop, and how late samples reach their coroutines: this file."""

from __future__ import annotations

import asyncio
import sys
import time
from contextlib import AsyncExitStack, ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from wheelwire import aio
from wheelwire.simulation.simulator import Simulator

LINKS = (1, 5, 20)
SETTLING_S = 0.5
MEASURED_S = 3.0


async def follow(robot: aio.Driver, late_ms: list[float]) -> None:
    """Note how old each sample is when the coroutine has it."""
    add = late_ms.append
    async for sample in robot.samples():
        add((time.monotonic() - sample.stamp) * 1e3)


async def measure(ports: list[str]) -> list[str]:
    """A row: links, CPU of one core, samples, and their age: median and 99th percentile."""
    late_ms: list[float] = []
    async with AsyncExitStack() as stack:
        openings = [aio.open_driver("serial", port=port) for port in ports]
        robots = [await stack.enter_async_context(opening) for opening in openings]
        tasks = [asyncio.ensure_future(follow(robot, late_ms)) for robot in robots]
        await asyncio.sleep(SETTLING_S)
        late_ms.clear()
        cpu_s, begin_s = time.process_time(), time.monotonic()
        await asyncio.sleep(MEASURED_S)
        cpu = (time.process_time() - cpu_s) / (time.monotonic() - begin_s)
        found = sorted(late_ms)
    await asyncio.gather(*tasks)
    ages = (f"{found[len(found) * percent // 100]:.2f}" for percent in (50, 99))
    return [str(len(ports)), f"{cpu:.1%}", str(len(found)), *ages]


def main() -> int:
    """Measure, and print the table."""
    with ExitStack() as stack:
        ports = [stack.enter_context(Simulator()).port for _ in range(max(LINKS))]
        rows = [asyncio.run(measure(ports[:links])) for links in LINKS]
    header = ("links", "CPU", "samples", "age [ms]", "99 %")
    sys.stdout.write(f"## asyncio\n\n100 samples a second on each link:\n\n{table(header, rows)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
