"""Decodes a capture in a separate process, to measure its memory. Arguments: FILE METHOD."""

from __future__ import annotations

import json
import re
import sys
from functools import partial
from pathlib import Path
from time import perf_counter

from wheelwire_protocol import decode_capture, iter_capture
from wheelwire_protocol.types import WheelState

READ_SIZE = 1 << 22


def in_parts(path: Path) -> int:
    """Number of frames, with at most `READ_SIZE` of the file in memory."""
    with path.open("rb") as file:
        parts = iter(partial(file.read, READ_SIZE), b"")
        return sum(len(states) for states in iter_capture(parts, WheelState))


def at_once(path: Path) -> int:
    """Number of frames, decoded into one array."""
    return len(decode_capture(path.read_bytes(), WheelState))


def peak_mib() -> float:
    """The peak memory of this process."""
    status = Path("/proc/self/status").read_text()
    found = re.search(r"VmHWM:\s*(\d+) kB", status)
    if found is None:
        raise RuntimeError("/proc/self/status has no VmHWM: needs Linux")
    return int(found[1]) / 1024


if __name__ == "__main__":
    decode = {"in parts": in_parts, "at once": at_once}[sys.argv[2]]
    before = perf_counter()
    frames = decode(Path(sys.argv[1]))
    taken = perf_counter() - before
    sys.stdout.write(json.dumps({"frames": frames, "seconds": taken, "peak_mib": peak_mib()}))
