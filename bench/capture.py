"""Bulk decoding of captures up to 1 GB, compared with C: `make bench`, or this file alone."""

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
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support import capture_worker
from support.benchmark import cpu_seconds, interleaved, output_folder, ratio, table
from support.captures import capture
from wheelwire_protocol import Decoder, decode_capture
from wheelwire_protocol.bulk import decode_columns
from wheelwire_protocol.codec import BY_TYPE
from wheelwire_protocol.types import WheelState

ROUNDS = 15
FRAMES = 50_000
SIZES_MB = (1, 10, 100, 1000)
LARGEST_ARRAY_MB = 100
"""The largest capture that is also decoded into one array."""

BULK = "`decode_capture`"
STREAM = "`Decoder`, in parts of 4096 bytes"
NUMPY = "numpy alone, where there is no library"
LOOP = "C: a loop for this message, CRC by zlib"
LOOP_BY_EIGHT = "C: the same, CRC eight bytes a step"
TARGET = 0.9
"""Target, relative to a C loop that processes eight bytes of the CRC per step."""

METHOD = f"""\
{FRAMES} frames of WheelState, 49 bytes each, to rows of a structured array, or in C to an array of
structures: nanoseconds of CPU a frame, medians of {ROUNDS} interleaved rounds. `decode_capture` and
`Decoder` are the firmware's decoder; the loop is `bench/decode_loop.c` at -O2, which knows
the one message.
"""
METHOD_OF_SIZES = f"""\
Files read and decoded in fresh processes: `iter_capture` in parts of
{capture_worker.READ_SIZE >> 20} MiB, and `decode_capture` of all at once. Peak memory is the
process's, Python and numpy included.
"""


class CLoop:
    """`decode_loop.c`, compiled where the bench runs."""

    def __init__(self, folder: Path) -> None:
        library = folder / "decode_loop.so"
        source = Path(__file__).with_name("decode_loop.c")
        compiler = os.environ.get("CC", "cc")
        command = [compiler, "-O2", "-shared", "-fPIC", str(source), "-o", str(library)]
        subprocess.run(command, check=True)
        self._library = ctypes.CDLL(str(library))
        self._library.decode.restype = ctypes.c_size_t
        self._library.decode.argtypes = (
            *(ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint8, ctypes.c_size_t),
            *(ctypes.c_void_p, ctypes.c_char_p),
        )
        self._library.prepare()
        # As pointers, so that the loop calls either of them without Python in between.
        zlib = ctypes.CDLL(find_library("z"))
        self.by_zlib = ctypes.cast(zlib.crc32, ctypes.c_void_p)
        self.by_eight = ctypes.cast(self._library.crc32_by_eight, ctypes.c_void_p)

    def count(self, data: bytes, crc32: ctypes.c_void_p, out: ctypes.Array[ctypes.c_char]) -> int:
        """Decode with one of both CRCs; returns the number of frames."""
        codec = BY_TYPE[WheelState]
        return int(self._library.decode(data, len(data), codec.id, codec.size, crc32, out))


def measure_speeds(folder: Path) -> dict[str, list[float]]:
    """Nanoseconds per frame, by method and round."""
    data = capture(FRAMES)
    out = ctypes.create_string_buffer(len(data))
    loop = CLoop(folder)
    ways: dict[str, Callable[[], int]] = {
        LOOP: lambda: loop.count(data, loop.by_zlib, out),
        LOOP_BY_EIGHT: lambda: loop.count(data, loop.by_eight, out),
        BULK: lambda: len(decode_capture(data, WheelState)),
        NUMPY: lambda: len(decode_columns(data, BY_TYPE[WheelState])),
        STREAM: lambda: stream(data),
    }
    # A decoder that misses frames would seem fast.
    for way, decode in ways.items():
        if decode() != FRAMES:
            raise RuntimeError(f"not all frames were decoded: {way}")
    measures = {way: partial(cpu_seconds, decode) for way, decode in ways.items()}
    times = interleaved(measures, ROUNDS)
    return {way: [1e9 / FRAMES * taken for taken in times[way]] for way in ways}


def stream(data: bytes) -> int:
    """The drivers' decoder over a capture."""
    decoder = Decoder()
    return sum(len(decoder.feed(data[at : at + 4096])) for at in range(0, len(data), 4096))


class Sized(NamedTuple):
    """One file decoded."""

    way: str
    megabytes: int
    frames: int
    seconds: float
    peak_mib: float


def measure_sizes(folder: Path) -> list[Sized]:
    """Decode files of growing size; only one at a time is on the disk."""
    block = capture(20_000)
    found = []
    for megabytes in SIZES_MB:
        path = folder / "capture"
        with path.open("wb") as file:
            for _ in range(megabytes * 1_000_000 // len(block)):
                file.write(block)
            # Up to the exact size, which may be in the middle of a frame.
            file.write(block[: megabytes * 1_000_000 - file.tell()])
        found.append(decode_apart(path, "in parts", megabytes))
        if megabytes <= LARGEST_ARRAY_MB:
            found.append(decode_apart(path, "at once", megabytes))
        path.unlink()
    return found


def decode_apart(path: Path, way: str, megabytes: int) -> Sized:
    """Decode in a fresh process."""
    # The kernel's account of peak memory is of a whole process, and never falls.
    command = [sys.executable, capture_worker.__file__, str(path), way]
    result = subprocess.run(command, check=True, capture_output=True, text=True)
    return Sized(way, megabytes, **json.loads(result.stdout))


def draw(sizes: list[Sized], file: Path) -> None:
    """Time and memory over the file's size."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.5), layout="constrained")
    times, memory = figure.subplots(1, 2)
    for way, colour in (("in parts", "#1b7837"), ("at once", "#878787")):
        of_way = [sized for sized in sizes if sized.way == way]
        megabytes = [sized.megabytes for sized in of_way]
        for axes, values in (
            (times, [sized.seconds for sized in of_way]),
            (memory, [sized.peak_mib for sized in of_way]),
        ):
            axes.loglog(megabytes, values, marker="o", color=colour, label=way)
            axes.set_xlabel("capture [MB]")
            axes.grid(alpha=0.3)
            axes.legend()
    times.set_ylabel("time [s]")
    memory.set_ylabel("peak memory [MiB]")
    figure.savefig(file, dpi=80)


def speed_rows(times: dict[str, list[float]]) -> list[list[str]]:
    """One row per method: time, and the bulk decoder's speed relative to it."""
    return [
        [way, f"{median(of_way):.0f}", f"{ratio(of_way, times[BULK]):.2f}"]
        for way, of_way in times.items()
    ]


def size_rows(sizes: list[Sized]) -> list[list[str]]:
    """One row per file and method."""
    return [
        [
            f"{sized.megabytes} MB, {sized.way}",
            *(str(sized.frames), f"{sized.seconds:.2f}"),
            *(f"{1e9 * sized.seconds / sized.frames:.0f}", f"{sized.peak_mib:.0f}"),
        ]
        for sized in sizes
    ]


def main() -> int:
    """Measure, print, draw; returns 1 if the target is missed."""
    folder = output_folder(__doc__)
    with TemporaryDirectory(dir=folder) as scratch:
        times = measure_speeds(Path(scratch))
        sizes = measure_sizes(Path(scratch))
    draw(sizes, folder / "capture.png")
    header = ("decoder", "ns a frame", "speed of `decode_capture`, as a share")
    sys.stdout.write(f"## Captures in bulk\n\n{METHOD}\n{table(header, speed_rows(times))}\n")
    sys.stdout.write(f"Target: at least {TARGET} of the speed of the faster C loop.\n\n")
    sys.stdout.write(f"{METHOD_OF_SIZES}\n")
    columns = ("capture", "frames", "time [s]", "ns a frame", "peak memory [MiB]")
    sys.stdout.write(f"{table(columns, size_rows(sizes))}\n![By size](capture.png)\n")
    return 0 if ratio(times[LOOP_BY_EIGHT], times[BULK]) >= TARGET else 1


if __name__ == "__main__":
    sys.exit(main())
