"""Drive in one task and watch in another: python examples/asyncio_drive.py /dev/ttyUSB0.

The robot is stopped however the program ends: by Ctrl-C, by an error in either task, or in time.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import sys
import time
from contextlib import suppress

from wheelwire import LinkLost, WheelwireError, aio

ROBOT = "a port, a YAML file, mock, ...; default: $WHEELWIRE_ROBOT"
PERIOD_S = 0.05
TTL_S = 0.3  # a setpoint expires after this, even if this program hangs


async def weave(robot: aio.Driver, seconds: float) -> None:
    """Drive forward, turning left and right in turn."""
    start = time.monotonic()
    while (elapsed := time.monotonic() - start) < seconds:
        try:
            robot.set_velocity(0.2, math.sin(elapsed), ttl=TTL_S)
        except LinkLost as lost:
            print(f"waiting: {lost}")  # the driver opens the port again by itself
        await asyncio.sleep(PERIOD_S)
    await robot.stop()


async def watch(robot: aio.Driver) -> None:
    """Print the state whenever it changes."""
    state = None
    async for sample in robot.samples():
        if sample.state is not state:
            state = sample.state
            print(f"{sample.t_us / 1e6:.2f} s: {state.name}")


async def main() -> None:
    """Weave for some seconds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", nargs="?", help=ROBOT)
    parser.add_argument("--seconds", type=float, default=5.0)
    arguments = parser.parse_args()

    async with aio.connect(arguments.robot) as robot:
        watching = asyncio.create_task(watch(robot))
        await weave(robot, arguments.seconds)
        await asyncio.sleep(0.5)  # to see the wheels stop
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching
    print("done")


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        try:
            asyncio.run(main())
        except WheelwireError as error:
            sys.exit(str(error))
