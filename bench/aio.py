"""asyncio.

How late samples reach coroutines of a loop, or threads, and the CPU that takes: {RATE_HZ} samples a
second on each link. With real-time priority, as by `chrt -f 5`, what else the computer does changes
little, but its scheduler moves the loop and the ports' thread between CPUs more often, which takes
more CPU.
"""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import AsyncExitStack, ExitStack

from harness import Report, run
from wheelwire import SerialDriver, aio
from wheelwire.simulation.simulator import Simulator

LINKS = (1, 5, 20)
RATE_HZ = 100
SETTLING_S = 0.5
MEASURED_S = 3.0


class Ages:
    """How old each sample is when the program gets it, and the CPU of one core during this."""

    def __init__(self) -> None:
        self.late_ms: list[float] = []

    def add(self, stamp: float) -> None:
        """A sample came."""
        self.late_ms.append((time.monotonic() - stamp) * 1e3)

    def begin(self) -> None:
        """Leave out what came before."""
        self.late_ms.clear()
        self._begin = time.process_time(), time.monotonic()

    def end(self) -> str:
        """CPU, samples, and their age: median and 99th percentile."""
        cpu_s, begin_s = self._begin
        cpu = (time.process_time() - cpu_s) / (time.monotonic() - begin_s)
        found = sorted(self.late_ms)
        p50, p99 = (found[len(found) * percent // 100] for percent in (50, 99))
        return f"{cpu:.1%} | {len(found)} | {p50:.2f} | {p99:.2f}"


async def on_a_loop(ports: list[str]) -> str:
    """All robots on one loop."""
    ages = Ages()

    async def follow(robot: aio.Driver) -> None:
        async for sample in robot.samples():
            ages.add(sample.stamp)

    async with AsyncExitStack() as stack:
        openings = [aio.open_driver("serial", port=port) for port in ports]
        robots = [await stack.enter_async_context(opening) for opening in openings]
        tasks = [asyncio.ensure_future(follow(robot)) for robot in robots]
        await asyncio.sleep(SETTLING_S)
        ages.begin()
        await asyncio.sleep(MEASURED_S)
        found = ages.end()
    await asyncio.gather(*tasks)
    return found


def on_threads(ports: list[str]) -> str:
    """A thread for each robot."""
    ages = Ages()

    def follow(robot: SerialDriver) -> None:
        for sample in robot.samples():
            ages.add(sample.stamp)

    with ExitStack() as stack:
        robots = [stack.enter_context(SerialDriver(port)) for port in ports]
        threads = [threading.Thread(target=follow, args=(robot,)) for robot in robots]
        for thread in threads:
            thread.start()
        time.sleep(SETTLING_S)
        ages.begin()
        time.sleep(MEASURED_S)
        found = ages.end()
    for thread in threads:
        thread.join()
    return found


def main(report: Report) -> None:
    """Measure, and print the table."""
    rows = []
    with ExitStack() as stack:
        ports = [stack.enter_context(Simulator()).port for _ in range(max(LINKS))]
        for links in LINKS:
            rows.append(f"{links} | a loop | {asyncio.run(on_a_loop(ports[:links]))}")
            rows.append(f"{links} | threads | {on_threads(ports[:links])}")
    report.table("links | on | CPU | samples | age [ms] | 99 %", rows)


run(main)
