"""How a library decodes a damaged stream of its own frames."""

from __future__ import annotations

import random
from typing import NamedTuple

from support.captures import wheel_states

from .base import Peer, parts_of

CORRUPT = 0.01
"""Part of all bytes that is replaced by other bytes."""

_FRAMES = 5000
_SEED = 1


class Survival(NamedTuple):
    """How many came through.

    Attributes:
        recovered: Of the frames that no damage touched, the share that was decoded.
        wrong: Messages that were never sent.
    """

    recovered: float
    wrong: int


def survival(peer: Peer) -> Survival:
    """Damage a stream, decode it and compare all numbers."""
    chance = random.Random(_SEED)
    frames = [peer.encode(peer.fields(state)) for state in wheel_states(_FRAMES)]
    damaged = [_damage(frame, chance) for frame in frames]
    sent = [peer.values(message) for message in peer.decode(parts_of(b"".join(frames)))]
    got = [peer.values(message) for message in peer.decode(parts_of(b"".join(damaged)))]
    ways = zip(sent, frames, damaged, strict=True)
    intact = {values for values, was, became in ways if was == became}
    known = set(sent)
    return Survival(
        recovered=len(intact.intersection(got)) / len(intact),
        wrong=sum(values not in known for values in got),
    )


def _damage(frame: bytes, chance: random.Random) -> bytes:
    return bytes(
        byte ^ chance.randint(1, 255) if chance.random() < CORRUPT else byte for byte in frame
    )
