"""Captures in bulk.

{FRAMES} frames of WheelState, 49 bytes each, to rows of an array: CPU in ns a frame, medians of
{ROUNDS} interleaved rounds. The loop in C is `bench/decode_loop.c` at -O2.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
from collections.abc import Callable
from ctypes.util import find_library
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from harness import Report, run
from support import capture_worker
from support.benchmark import cpu_seconds, interleaved, ratio
from support.captures import capture
from wheelwire_protocol import Decoder, decode_capture
from wheelwire_protocol.bulk import decode_columns
from wheelwire_protocol.codec import BY_TYPE
from wheelwire_protocol.types import WheelState

ROUNDS = 15
FRAMES = 50_000
SIZES_MB = (1, 100, 1000)
LARGEST_ARRAY_MB = 100
"""The largest capture that is also decoded into one array."""

BULK = "`decode_capture`"
LOOP_BY_EIGHT = "C: the same, CRC eight bytes a step"
TARGET = 0.9
"""Target, relative to a C loop that processes eight bytes of the CRC per step."""
SIZES = f"""\
Files, each decoded in a fresh process: by `iter_capture` in parts of
{capture_worker.READ_SIZE >> 20} MiB, or by `decode_capture` at once. *Peak* is the process's memory
in MiB."""


def c_loop(folder: Path) -> Callable[[bytes, bool, ctypes.Array[ctypes.c_char]], int]:
    """`decode_loop.c`, compiled here, with zlib's CRC or with its own."""
    path, source = folder / "decode_loop.so", Path(__file__).with_name("decode_loop.c")
    compiler = os.environ.get("CC", "cc")
    command = [compiler, "-O2", "-shared", "-fPIC", str(source), "-o", str(path)]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(path))
    library.decode.restype = ctypes.c_size_t
    library.decode.argtypes = (
        *(ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint8, ctypes.c_size_t),
        *(ctypes.c_void_p, ctypes.c_char_p),
    )
    library.prepare()
    # As pointers, so that the loop calls either of them without Python in between.
    crcs = ctypes.CDLL(find_library("z")).crc32, library.crc32_by_eight
    of_zlib, own = (ctypes.cast(crc, ctypes.c_void_p) for crc in crcs)
    codec = BY_TYPE[WheelState]

    def count(data: bytes, by_eight: bool, out: ctypes.Array[ctypes.c_char]) -> int:
        crc = own if by_eight else of_zlib
        return int(library.decode(data, len(data), codec.id, codec.size, crc, out))

    return count


def stream(data: bytes) -> int:
    """The drivers' decoder over a capture."""
    decoder = Decoder()
    return sum(len(decoder.feed(data[at : at + 4096])) for at in range(0, len(data), 4096))


def speeds(folder: Path) -> dict[str, list[float]]:
    """Nanoseconds per frame, by method and round."""
    data = capture(FRAMES)
    out, loop = ctypes.create_string_buffer(len(data)), c_loop(folder)
    ways: dict[str, Callable[[], int]] = {
        "C: a loop for this message, CRC by zlib": lambda: loop(data, False, out),
        LOOP_BY_EIGHT: lambda: loop(data, True, out),
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
    return {way: [1e9 / FRAMES * taken for taken in times[way]] for way in ways}


def sizes(folder: Path) -> list[str]:
    """Decode files of growing size; only one at a time is on the disk."""
    block, path, rows = capture(20_000), folder / "capture", []
    for megabytes in SIZES_MB:
        with path.open("wb") as file:
            for _ in range(megabytes * 1_000_000 // len(block)):
                file.write(block)
            # Up to the exact size, which may be in the middle of a frame.
            file.write(block[: megabytes * 1_000_000 - file.tell()])
        cells = [f"{megabytes} MB"]
        for way in ("in parts", *["at once"] * (megabytes <= LARGEST_ARRAY_MB)):
            # The kernel's account of peak memory is of a whole process, and never falls.
            command = [sys.executable, capture_worker.__file__, str(path), way]
            result = subprocess.run(command, check=True, capture_output=True, text=True)
            found = json.loads(result.stdout)
            cells.append(f"{1e9 * found['seconds'] / found['frames']:.0f}")
            cells.append(f"{found['peak_mib']:.0f}")
        rows.append(" | ".join([*cells, *["-"] * (5 - len(cells))]))
        path.unlink()
    return rows


def main(report: Report) -> None:
    """Measure and print."""
    with TemporaryDirectory(dir=report.folder) as scratch:
        times = speeds(Path(scratch))
        rows = sizes(Path(scratch))
    report.items(f"{way} | {median(of_way):.0f}" for way, of_way in times.items())
    report.say(SIZES)
    report.table("capture | in parts: ns a frame | peak | at once: ns a frame | peak", rows)
    share = ratio(times[LOOP_BY_EIGHT], times[BULK])
    what = "speed of `decode_capture` / of the faster C loop"
    report.target(what, f"{share:.2f}", f">= {TARGET}", share >= TARGET)


run(main)
