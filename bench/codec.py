"""The codec and its peers.

CPU a frame, numbers to frame (*encode*) and stream to objects with numbers (*decode*, in parts of
4096 or 64 bytes); medians of {ROUNDS} interleaved rounds. The message is WheelState, 13 numbers in
39 bytes, or the library's own of equal weight. With {CORRUPT:.0%} of all bytes replaced:
*recovered* is the share of undamaged frames decoded, and the remark counts *wrong* messages, which
nobody sent.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from statistics import median

from harness import Report, run
from peers import OURS, THEIRS, Peer, Pymavlink, Streaming
from support.benchmark import cpu_seconds, interleaved, ratio
from support.captures import wheel_states

ROUNDS = 9
FRAMES = 5000
"""Enough frames to outweigh a decoder's first ones."""
BATCH_FRAMES = 20_000
"""Large enough to outweigh the cost of the calls."""
PART_SIZES = (4096, 64)
CORRUPT = 0.01
"""Part of all bytes that is replaced by other bytes."""
TARGET = 14
"""Our speed of decoding a stream, as a multiple of pymavlink's."""
HEADER = "library | encode [us] | decode, 4096 [us] | decode, 64 [us] | recovered | bytes | remark"


def parts_of(stream: bytes, size: int = PART_SIZES[0]) -> list[bytes]:
    """The stream as a driver reads it."""
    return [stream[at : at + size] for at in range(0, len(stream), size)]


class Candidate:
    """One library with its own frames."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        count = FRAMES if peer.streams else BATCH_FRAMES
        # In the form that the library needs: the conversion to it does not count as encoding.
        self._fields = [peer.fields(state) for state in wheel_states(count)]
        stream = b"".join(map(peer.encode, self._fields))
        self.frame_size = len(stream) / count
        self._parts = {size: parts_of(stream, size) for size in PART_SIZES}

    def measures(self) -> Iterator[tuple[str, Callable[[], float]]]:
        """Name and measure, in microseconds a frame, of all that the library does."""
        yield f"{self.peer.name} encode", self._encode_us
        for size in PART_SIZES if self.peer.streams else PART_SIZES[:1]:
            yield f"{self.peer.name} {size}", partial(self._decode_us, size)

    def _encode_us(self) -> float:
        encode, fields = self.peer.encode, self._fields
        return 1e6 / len(fields) * cpu_seconds(lambda: [encode(each) for each in fields])

    def _decode_us(self, part_size: int) -> float:
        decoded = []
        taken = cpu_seconds(lambda: decoded.append(self.peer.decode(self._parts[part_size])))
        # A decoder that misses frames would seem fast.
        if len(decoded[0]) != len(self._fields):
            raise RuntimeError(f"{self.peer.name} decoded {len(decoded[0])} frames")
        return 1e6 / len(self._fields) * taken


def survival(peer: Peer) -> tuple[float, int]:
    """Damage a stream, decode it and compare all numbers.

    Returns:
        Of the frames that no damage touched, the share that was decoded; and how many messages
        came that were never sent.
    """
    chance = random.Random(1)
    frames = [peer.encode(peer.fields(state)) for state in wheel_states(FRAMES)]
    damaged = [_damage(frame, chance) for frame in frames]
    sent = [peer.values(message) for message in peer.decode(parts_of(b"".join(frames)))]
    got = [peer.values(message) for message in peer.decode(parts_of(b"".join(damaged)))]
    ways = zip(sent, frames, damaged, strict=True)
    intact = {values for values, was, became in ways if was == became}
    known = set(sent)
    recovered = len(intact.intersection(got)) / len(intact)
    return recovered, sum(values not in known for values in got)


def _damage(frame: bytes, chance: random.Random) -> bytes:
    return bytes(
        byte ^ chance.randint(1, 255) if chance.random() < CORRUPT else byte for byte in frame
    )


def main(report: Report) -> None:
    """Measure and print."""
    candidates = [Candidate(peer()) for peer in (*OURS, *THEIRS)]
    measures = [pair for candidate in candidates for pair in candidate.measures()]
    # All libraries in each round, so that a slow moment of the computer affects all of them.
    times = interleaved(dict(measures), ROUNDS)
    rows, wrong = [], 0
    for candidate in candidates:
        peer = candidate.peer
        found = [times.get(f"{peer.name} {what}") for what in ("encode", *PART_SIZES)]
        cells = " | ".join("-" if of is None else f"{median(of):.2f}" for of in found)
        recovered, of_nobody = survival(peer)
        wrong += of_nobody * isinstance(peer, OURS)
        remark = f"{peer.remark}; {of_nobody} wrong" if of_nobody else peer.remark
        rows.append(
            f"{peer.name} {version(peer.distribution)} | {cells} | {recovered:.1%} | "
            f"{candidate.frame_size:.1f} | {remark}"
        )
    report.table(HEADER, rows)
    theirs, ours = (times[f"{peer.name} {PART_SIZES[0]}"] for peer in (Pymavlink, Streaming))
    report.at_least("pymavlink's decode / our stream", ratio(theirs, ours), TARGET, ".1f")
    report.equal("our wrong messages", wrong, 0)


run(main)
