"""Captures in bulk.

{FRAMES} frames of WheelState, 49 bytes each, to rows of an array: CPU in ns a frame, medians of
{ROUNDS} interleaved rounds. The loop in C is `bench/decode_loop.c` at -O2, with a CRC of eight
bytes a step.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

from harness import Report, run
from support.benchmark import cpu_seconds, interleaved, ratio
from support.captures import capture
from wheelwire_protocol import Decoder, decode_capture
from wheelwire_protocol.bulk import decode_columns
from wheelwire_protocol.codec import BY_TYPE
from wheelwire_protocol.types import WheelState

ROUNDS = 15
FRAMES = 50_000
C_LOOP = "C: a loop for this message"
BULK = "`decode_capture`"
TARGET = 0.9
"""The speed of `decode_capture`, relative to the loop in C."""


def c_loop(folder: Path, data: bytes) -> Callable[[], int]:
    """`decode_loop.c`, compiled here, over a capture."""
    path, source = folder / "decode_loop.so", Path(__file__).with_name("decode_loop.c")
    compiler = os.environ.get("CC", "cc")
    command = [compiler, "-O2", "-shared", "-fPIC", str(source), "-o", str(path)]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(path))
    library.decode.restype = ctypes.c_size_t
    library.decode.argtypes = (
        *(ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint8, ctypes.c_size_t),
        ctypes.c_char_p,
    )
    library.prepare()
    codec, out = BY_TYPE[WheelState], ctypes.create_string_buffer(len(data))
    return lambda: int(library.decode(data, len(data), codec.id, codec.size, out))


def stream(data: bytes) -> int:
    """The drivers' decoder over a capture."""
    decoder = Decoder()
    return sum(len(decoder.feed(data[at : at + 4096])) for at in range(0, len(data), 4096))


def main(report: Report) -> None:
    """Measure and print."""
    data = capture(FRAMES)
    ways: dict[str, Callable[[], int]] = {
        C_LOOP: c_loop(report.folder, data),
        BULK: lambda: len(decode_capture(data, WheelState)),
        "numpy alone, where there is no library": lambda: len(
            decode_columns(data, BY_TYPE[WheelState])
        ),
        "`Decoder`, in parts of 4096 bytes": lambda: stream(data),
    }
    # A decoder that misses frames would seem fast.
    for way, decode in ways.items():
        if decode() != FRAMES:
            raise RuntimeError(f"not all frames were decoded: {way}")
    times = interleaved({way: partial(cpu_seconds, of) for way, of in ways.items()}, ROUNDS)
    report.items(f"{way} | {1e9 / FRAMES * median(taken):.0f}" for way, taken in times.items())
    share = ratio(times[C_LOOP], times[BULK])
    report.at_least("speed of `decode_capture` / of the loop in C", share, TARGET, ".2f")


run(main)
