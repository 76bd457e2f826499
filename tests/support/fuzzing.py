"""The firmware's fuzz targets: their seeds, their cases, and how they are built and run."""

from __future__ import annotations

import json
import struct
import subprocess
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path

from wheelwire_protocol.parameters import PARAMETERS

from .processes import captured

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build" / "fuzz"
CASES = ROOT / "firmware" / "esp32" / "fuzz" / "cases"
VECTORS = ROOT / "protocol" / "vectors"
TARGETS = ("decoder", "session", "parameters")

LONGEST = 4096
"""The longest input in bytes: some hundred messages."""

_MESSAGE, _PLAUSIBLE, _STEPS = b"\x01", b"\x02", b"\x03"
_HEADER_SIZE, _CRC_SIZE = 3, 4


def seed(target: str) -> Path:
    """Write the seeds and the cases of a target, as files; returns their folder."""
    folder = BUILD / "seeds" / target
    folder.mkdir(parents=True, exist_ok=True)
    for number, data in enumerate(_SEEDS[target]()):
        (folder / f"vector-{number:03}").write_bytes(data)
    for case in sorted((CASES / target).glob("*.hex")):
        (folder / case.stem).write_bytes(read_case(case))
    return folder


def read_case(path: Path) -> bytes:
    """The input that a case describes: bytes in hexadecimal, and comments behind a `#`."""
    lines = path.read_text("utf-8").splitlines()
    return bytes.fromhex(" ".join(line.partition("#")[0] for line in lines))


def fuzz(target: str, seconds: float) -> subprocess.CompletedProcess[str]:
    """Fuzz one target for a time. New inputs stay for the next run.

    A failing input is written to `build/fuzz`, and its name to stderr.
    """
    corpus = BUILD / "corpus" / target
    corpus.mkdir(parents=True, exist_ok=True)
    return captured(
        ROOT / "build" / "asan" / f"wheelwire-fuzz-{target}",
        *(f"-max_total_time={seconds:g}", f"-max_len={LONGEST}"),
        *(f"-artifact_prefix={BUILD}/{target}-", "-print_final_stats=1"),
        *(corpus, seed(target)),
    )


def _vectors() -> tuple[list[bytes], list[bytes]]:
    """Payloads of single frames, and the bytes of whole streams."""
    handmade = json.loads((VECTORS / "handmade.json").read_text("utf-8"))
    generated = json.loads((VECTORS / "generated.json").read_text("utf-8"))
    frames = handmade["frames"] + generated["frames"]
    payloads = [bytes.fromhex(frame["payload"]) for frame in frames]
    lines = [bytes.fromhex("".join(stream["bytes"])) for stream in handmade["streams"]]
    return payloads, [*lines, *(bytes.fromhex(frame["frame"]) for frame in frames)]


def _session_seeds() -> Iterator[bytes]:
    """Each message in an open session, then some steps; see fuzz_session.cpp for the script."""
    payloads, _ = _vectors()
    opening = next(read_case(path) for path in sorted((CASES / "session").glob("a_setpoint*")))
    for payload in payloads:
        message = payload[:1] + payload[_HEADER_SIZE:-_CRC_SIZE]
        yield opening + _PLAUSIBLE + message + _STEPS + b"\x32"
        yield _MESSAGE + message + _STEPS + b"\x02"


def _parameter_seeds() -> Iterator[bytes]:
    """Entries, and whole blocks of the store; see fuzz_parameters.cpp."""
    entries, minima, maxima = (
        [struct.pack("<Bf", p.id, value(p)) for p in PARAMETERS]
        for value in (attrgetter("default"), attrgetter("minimum"), attrgetter("maximum"))
    )
    foreign = struct.pack("<Bf", 255, float("nan"))
    # More of them than the block has room for would not be looked at.
    for rows in ([], entries, minima, maxima, entries[:3] * 2, [foreign]):
        yield b"\x01" + b"".join(rows)
        yield b"\x00WWP2" + bytes([len(rows)]) + b"".join(rows)


_SEEDS = {
    "decoder": lambda: iter(_vectors()[1]),
    "session": _session_seeds,
    "parameters": _parameter_seeds,
}
