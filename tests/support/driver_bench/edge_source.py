"""Edges of two encoders at a given rate, as lgpio's own thread writes them: into a pipe.

`python -m support.driver_bench.edge_source TICKS_PER_S SECONDS` writes reports to its standard
output, and drops those for which the pipe has no room. It ends with the true number of ticks and
the seconds that they took, on standard error.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import suppress

import numpy as np

from wheelwire.plant.encoder import LEVELS

REPORT = np.dtype([("t_ns", "<u8"), ("input", "<u4"), ("level", "<u4")])
"""16 bytes, as lgpio's. Inputs are 2 x wheel + channel."""
BATCH_S = 0.001
CYCLE = 4

_CHANNEL = np.array([LEVELS[i - 1][0] == LEVELS[i][0] for i in range(CYCLE)], int)
_LEVEL = np.array([LEVELS[i][_CHANNEL[i]] for i in range(CYCLE)])
"""Of the edge into interval i: the channel that changes, and to what."""


def reports(first: int, last: int, start_s: float, rate: float) -> bytes:
    """The edges into the intervals from `first` to `last`, of both wheels."""
    ticks = np.repeat(np.arange(first, last + 1), 2)
    made = np.zeros(ticks.size, REPORT)
    made["t_ns"] = ((start_s + ticks / rate) * 1e9).astype(np.int64)
    made["input"] = _CHANNEL[ticks % CYCLE] + 2 * (np.arange(ticks.size) % 2)
    made["level"] = _LEVEL[ticks % CYCLE]
    return made.tobytes()


def main() -> None:
    """See the module."""
    rate, seconds = float(sys.argv[1]), float(sys.argv[2])
    os.set_blocking(1, False)
    start = time.monotonic()
    ticks = 0
    while (elapsed := time.monotonic() - start) < seconds:
        due = int(elapsed * rate) // CYCLE * CYCLE  # whole cycles, so that runs fit together
        if due > ticks:
            data = memoryview(reports(ticks + 1, due, start, rate))
            while data:  # a report is written whole or not at all
                with suppress(BlockingIOError):
                    os.write(1, data[: REPORT.itemsize * 64])
                data = data[REPORT.itemsize * 64 :]
            ticks = due
        time.sleep(BATCH_S)
    sys.stderr.write(f"{2 * ticks} {elapsed}\n")


if __name__ == "__main__":
    main()
