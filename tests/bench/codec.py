"""The codec against its peers: `python tests/bench/codec.py`. Needs the extra `bench`.

All candidates decode telemetry in interleaved rounds of one run. Each time is the median over the
rounds, each ratio the median of the ratios within a round: what slows a round slows both sides.
"""

from __future__ import annotations

import gc
import os
import struct
import sys
from collections.abc import Callable
from statistics import median
from time import perf_counter
from typing import NamedTuple
from zlib import crc32

from cobs import cobs
from construct import Int8ul, Int16ul, Int32ul, Struct
from rich.console import Console
from rich.table import Table

from wheelwire_protocol import Decoder, Encoder, decode_capture
from wheelwire_protocol.framing import CRC_RESIDUE, DELIMITER
from wheelwire_protocol.messages import WHEEL_STATE
from wheelwire_protocol.reference import crc32 as crcmod_crc32
from wheelwire_protocol.types import WheelState

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import common  # the version is read at import

READ_SIZE = 4096
"""Bytes handed to a streaming decoder at once, as a serial driver reads them."""

ROUNDS = 15
FRAMES = 20_000
SLOW_FRAMES = 1000
"""For the slow ones: fewer frames give as good a figure."""


class Aim(NamedTuple):
    """`slow` takes at least, or at most, so many times as long as `fast`."""

    text: str
    slow: str
    fast: str
    at_least: float = 0.0
    at_most: float = float("inf")


AIMS = (
    Aim("pymavlink / streaming", "pymavlink", "streaming", at_least=8),
    Aim("plain construct / streaming", "construct", "streaming", at_least=20),
    Aim("streaming / bare loop", "streaming", "bare loop", at_most=1.7),
    Aim("streaming / bulk", "streaming", "bulk", at_least=3),
)


def wheel_states(count: int) -> bytes:
    """A capture of a robot that drives a curve."""
    encoder = Encoder()
    frames = (
        WheelState(
            boot_id=0x5EED1234,
            t_us=1000 * i,
            left_ticks=7 * i // 10,
            right_ticks=-9 * i // 10,
            left_mps=0.25 + i % 16 / 512,
            right_mps=-0.3,
            left_duty_q15=12_000 + i % 100,
            right_duty_q15=-14_000,
            command_seq=i // 20,
            supervisor=2,
            faults=0,
            overruns=0,
            battery_mv=11_800 - i % 7,
        )
        for i in range(count)
    )
    return b"".join(map(encoder.encode, frames))


def generator_statuses(count: int) -> bytes:
    """MAVLink's GENERATOR_STATUS: 42 bytes in 11 numbers; a WheelState has 39 bytes in 13."""
    sender = common.MAVLink(None, srcSystem=1, srcComponent=1)
    frames = (
        common.MAVLink_generator_status_message(
            status=0x5EED1234,
            generator_speed=1200 + i % 100,
            battery_current=0.25 + i % 16 / 512,
            load_current=-0.3,
            power_generated=12.5,
            bus_voltage=11.8,
            rectifier_temperature=40,
            bat_current_setpoint=0.5,
            generator_temperature=45,
            runtime=1000 * i,
            time_until_maintenance=-9 * i - 1,
        )
        for i in range(count)
    )
    return b"".join(frame.pack(sender) for frame in frames)


def reads(stream: bytes) -> list[bytes]:
    """The stream as a driver gets it."""
    return [stream[at : at + READ_SIZE] for at in range(0, len(stream), READ_SIZE)]


def streaming(parts: list[bytes]) -> int:
    """Our decoder: typed messages, loss counted."""
    decoder = Decoder()
    return sum(len(decoder.feed(part)) for part in parts)


def bare_loop(parts: list[bytes]) -> int:
    """Split, COBS, CRC and `struct` alone: no types, no sequence, no errors caught."""
    unpack = struct.Struct(f"<3x{WHEEL_STATE.body_format}4x").unpack
    decode, partial, frames = cobs.decode, b"", 0
    for part in parts:
        *chunks, partial = (partial + part).split(DELIMITER)
        for chunk in chunks:
            if chunk:
                payload = decode(chunk)
                if crc32(payload) == CRC_RESIDUE:
                    unpack(payload)
                    frames += 1
    return frames


def plain_construct(parts: list[bytes]) -> int:
    """The same loop with construct in the place of `struct`, and crcmod for the CRC."""
    layout = Struct("id" / Int8ul, "seq" / Int16ul, "body" / WHEEL_STATE.body, "crc" / Int32ul)
    partial, frames = b"", 0
    for part in parts:
        *chunks, partial = (partial + part).split(DELIMITER)
        for chunk in filter(None, chunks):
            payload = cobs.decode(chunk)
            if crcmod_crc32(payload) == CRC_RESIDUE:
                layout.parse(payload)
                frames += 1
    return frames


def pymavlink(parts: list[bytes]) -> int:
    """The peer: its parser over a stream of its own frames."""
    parser = common.MAVLink(None)
    return sum(len(parser.parse_buffer(part) or ()) for part in parts)


class Candidate(NamedTuple):
    """Something that decodes `frames` frames, and says how many it found."""

    frames: int
    decode: Callable[[], int]

    def time_ns(self) -> float:
        """Nanoseconds a frame in one run."""
        gc.collect()
        begin = perf_counter()
        found = self.decode()
        elapsed = perf_counter() - begin
        if found != self.frames:
            raise RuntimeError(f"{found} of {self.frames} frames were decoded")
        return elapsed / self.frames * 1e9


def candidates() -> dict[str, Candidate]:
    """What is compared, by name."""
    capture = wheel_states(FRAMES)
    many, few = reads(capture), reads(wheel_states(SLOW_FRAMES))
    peer = reads(generator_statuses(SLOW_FRAMES))
    return {
        "bulk": Candidate(FRAMES, lambda: len(decode_capture(capture, WheelState))),
        "bare loop": Candidate(FRAMES, lambda: bare_loop(many)),
        "streaming": Candidate(FRAMES, lambda: streaming(many)),
        "pymavlink": Candidate(SLOW_FRAMES, lambda: pymavlink(peer)),
        "construct": Candidate(SLOW_FRAMES, lambda: plain_construct(few)),
    }


def measure() -> dict[str, list[float]]:
    """Nanoseconds a frame, by candidate and round. The first round warms up, and is left out."""
    compared = candidates()
    times: dict[str, list[float]] = {name: [] for name in compared}
    for _ in range(1 + ROUNDS):
        for name, candidate in compared.items():
            times[name].append(candidate.time_ns())
    return {name: rounds[1:] for name, rounds in times.items()}


def report(times: dict[str, list[float]]) -> None:
    """Print what was measured, and how it stands to the aims."""
    console = Console()
    speeds = Table("decoder", "ns a frame", "thousand frames/s", title="Decoding telemetry")
    for name, rounds in times.items():
        speeds.add_row(name, f"{median(rounds):.0f}", f"{1e6 / median(rounds):.0f}")
    aims = Table("ratio", "measured", "aim", "", title=f"Median of {ROUNDS} rounds")
    for aim in AIMS:
        ratio = median(a / b for a, b in zip(times[aim.slow], times[aim.fast], strict=True))
        good = aim.at_least <= ratio <= aim.at_most
        wanted = f">= {aim.at_least:g}" if aim.at_least else f"<= {aim.at_most:g}"
        aims.add_row(aim.text, f"{ratio:.2f}", wanted, "reached" if good else "MISSED")
    console.print(speeds, aims)


if __name__ == "__main__":
    if common.mcrf4xx is None:
        sys.exit("pymavlink runs without fastcrc, an unfair peer: pip install fastcrc")
    report(measure())
