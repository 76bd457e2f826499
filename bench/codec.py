"""The codec against its peers: `make bench`, or this file alone. Needs the extra `bench`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
# The peers are a package, `bench.peers`.
sys.path.insert(0, str(Path(__file__).parents[1]))
from bench.peers import ABSENT, OURS, THEIRS
from bench.peers.base import Peer, parts_of
from bench.peers.mavlink import Pymavlink
from bench.peers.ours import Streaming
from bench.peers.survival import CORRUPT, Survival, survival
from support.benchmark import (
    Target,
    cpu_seconds,
    import_ms,
    interleaved,
    output_folder,
    ratio,
    table,
    table_of_targets,
)
from support.captures import wheel_states

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROUNDS = 9
FRAMES = 5000
"""Enough frames to outweigh a decoder's first ones."""
BATCH_FRAMES = 20_000
"""Large enough to outweigh the cost of the calls."""
PART_SIZES = (4096, 64)
STARTS = 5

TARGET = 16
"""Target: our speed of decoding a stream, as a multiple of pymavlink's."""

METHOD = f"""\
From the numbers to a frame, and back from a stream that arrives in parts of 4096 or 64 bytes to
objects whose fields are numbers: microseconds of CPU a frame, medians of {ROUNDS} interleaved
rounds. The message is WheelState, 13 numbers in 39 bytes, or the protocol's own of equal
weight. Then
{100 * CORRUPT:g} % of all bytes are replaced: *recovered* are the frames decoded of those that
no damage touched, *wrong* the messages that came out and were never sent. *Bytes* are those on the
wire for one message, *import* is in a fresh interpreter, less what that takes for nothing.
"""
HEADER = (
    *("library", "version", "encode [us]", "decode, 4096 [us]", "decode, 64 [us]"),
    *("recovered", "wrong", "bytes", "import [ms]", "remark"),
)
NOT_MEASURED = "-"


class Candidate:
    """One library with its own frames."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        count = FRAMES if peer.streams else BATCH_FRAMES
        # In the form that the library wants: making that is no part of its encoding.
        self._fields = [peer.fields(state) for state in wheel_states(count)]
        stream = b"".join(map(peer.encode, self._fields))
        self.frame_size = len(stream) / count
        self._parts = {size: parts_of(stream, size) for size in PART_SIZES}

    def measures(self) -> Iterator[tuple[str, Callable[[], float]]]:
        """Name and measure, in microseconds a frame, of all that the library does."""
        if self.peer.encodes:
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


class Results:
    """All that was measured."""

    def __init__(self) -> None:
        self.candidates = [Candidate(peer()) for peer in (*OURS, *THEIRS)]
        peers = [candidate.peer for candidate in self.candidates]
        measures = [pair for candidate in self.candidates for pair in candidate.measures()]
        # All libraries in each round, so that a slow moment of the computer affects all of them.
        self.times = interleaved(dict(measures), ROUNDS)
        self.survivals = {peer.name: survival(peer) for peer in peers}
        self.imports = import_ms(sorted({peer.module for peer in peers}), STARTS)

    def decoding_us(self, peer: type[Peer] | Peer, part_size: int = PART_SIZES[0]) -> list[float]:
        """A library's times per frame, by round."""
        return self.times[f"{peer.name} {part_size}"]

    def against(self, ours: type[Peer], theirs: type[Peer] | Peer) -> float:
        """How many times as fast as theirs our decoding is."""
        return ratio(self.decoding_us(theirs), self.decoding_us(ours))

    def rows(self) -> Iterator[list[str]]:
        """The cells below `HEADER`, one row per library."""
        for candidate in self.candidates:
            peer = candidate.peer
            names = (f"{peer.name} {what}" for what in ("encode", *PART_SIZES))
            times = (self.times.get(name) for name in names)
            survived = self.survivals[peer.name]
            yield [
                *(peer.name, version(peer.distribution)),
                *(NOT_MEASURED if of is None else f"{median(of):.2f}" for of in times),
                *(f"{survived.recovered:.1%}", str(survived.wrong)),
                *(f"{candidate.frame_size:.1f}", f"{self.imports[peer.module]:.0f}", peer.remark),
            ]
        for name, reason in ABSENT.items():
            yield [name, *[NOT_MEASURED] * (len(HEADER) - 2), reason]

    def wrong(self) -> int:
        """Messages that our decoders delivered but nobody sent."""
        survivals: list[Survival] = [self.survivals[ours.name] for ours in OURS]
        return sum(survived.wrong for survived in survivals)


def targets(results: Results) -> list[Target]:
    """The targets: speed, and no invented message."""
    stream, wrong = results.against(Streaming, Pymavlink), results.wrong()
    return [
        Target(
            "pymavlink's decode / our stream", f"{stream:.1f}", f">= {TARGET}", stream >= TARGET
        ),
        Target("our wrong messages", str(wrong), "0", wrong == 0),
    ]


def ratios(results: Results) -> str:
    """How many times as long each peer takes to decode."""
    rows = [
        [theirs.name, *(f"{results.against(ours, theirs):.1f}" for ours in OURS)]
        for theirs in THEIRS
    ]
    return table(("decoding, times as long as", "our batch", "our stream"), rows)


def draw(results: Results, file: Path) -> None:
    """Times and survivals, one bar per library."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.5), layout="constrained")
    times, recovered = figure.subplots(1, 2, sharey=True)
    # Ours are bold in the table.
    names = [candidate.peer.name.strip("*") for candidate in results.candidates]
    colours = ["#1b7837"] * len(OURS) + ["#878787"] * len(THEIRS)
    decoding = [median(results.decoding_us(c.peer)) for c in results.candidates]
    _bars(times, names, decoding, colours, "decode, us a frame")
    times.set_xscale("log")
    shares = [100 * results.survivals[c.peer.name].recovered for c in results.candidates]
    label = f"intact frames decoded, {100 * CORRUPT:g} % of all bytes damaged [%]"
    _bars(recovered, names, shares, colours, label)
    # From top to bottom as in the table; the two panels share this axis.
    times.invert_yaxis()
    figure.savefig(file, dpi=80)


def _bars(
    axes: Axes, names: list[str], values: list[float], colours: list[str], label: str
) -> None:
    bars = axes.barh(names, values, color=colours)
    axes.bar_label(bars, fmt="%.3g", padding=3, fontsize=8)
    axes.set_xlabel(label)
    axes.grid(axis="x", alpha=0.3)
    axes.margins(x=0.12)


def main() -> int:
    """Measure, print, draw; returns 1 if a target is missed."""
    folder = output_folder(__doc__)
    results = Results()
    draw(results, folder / "codec.png")
    found = targets(results)
    sys.stdout.write(f"## The codec and its peers\n\n{METHOD}\n{table(HEADER, results.rows())}\n")
    sys.stdout.write(f"{ratios(results)}\n{table_of_targets(found)}\n![Decoding](codec.png)\n")
    return 0 if all(target.reached for target in found) else 1


if __name__ == "__main__":
    sys.exit(main())
