"""The codec's peers. Needs the extra `bench`."""

from __future__ import annotations

from .base import Peer
from .cobs_frames import CompiledConstruct, PlainConstruct, ProtobufOverCobs
from .hdlc import PigweedHdlc
from .mavlink import Pymavlink
from .ours import Batch, Streaming

OURS: tuple[type[Peer], ...] = (Batch, Streaming)
THEIRS: tuple[type[Peer], ...] = (
    ProtobufOverCobs,
    Pymavlink,
    PigweedHdlc,
    CompiledConstruct,
    PlainConstruct,
)
