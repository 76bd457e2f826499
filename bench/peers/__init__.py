"""The codec's peers, one module each. Needs the extra `bench`."""

from __future__ import annotations

from .base import Peer
from .construct_cobs import CompiledConstruct, PlainConstruct
from .dynamixel import DynamixelSdk
from .firmata import Pyfirmata2
from .hdlc import PigweedHdlc
from .mavlink import Pymavlink
from .moteus_uart import Moteus
from .ours import Batch, Streaming
from .protobuf_cobs import ProtobufOverCobs
from .ubx import Pyubx2

OURS: tuple[type[Peer], ...] = (Batch, Streaming)
THEIRS: tuple[type[Peer], ...] = (
    ProtobufOverCobs,
    Pymavlink,
    DynamixelSdk,
    PigweedHdlc,
    CompiledConstruct,
    PlainConstruct,
    Pyubx2,
    Moteus,
    Pyfirmata2,
)
