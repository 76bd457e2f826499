"""pyubx2: u-blox's binary protocol with its NAV-VELNED, 36 bytes in 9 numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pyubx2 import ERR_IGNORE, GET, UBX_PROTOCOL, UBXMessage, UBXReader

from wheelwire_protocol.types import WheelState

from .base import Peer, SerialStandIn


class Pyubx2(Peer):
    """The message is of equal weight, as the protocol has its own."""

    name = "pyubx2"
    distribution = "pyubx2"
    remark = "Fletcher-16; 9 numbers"

    def fields(self, state: WheelState) -> dict[str, Any]:
        return {
            "iTOW": state.t_us,
            "velN": state.left_ticks,
            "velE": state.right_ticks,
            "velD": state.left_duty_q15,
            "speed": state.command_seq,
            "gSpeed": state.boot_id,
            "heading": state.right_duty_q15 / 100,
            "sAcc": state.battery_mv,
            "cAcc": state.overruns / 100,
        }

    def encode(self, fields: Any) -> bytes:
        return bytes(UBXMessage("NAV", "NAV-VELNED", GET, **fields).serialize())

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        reader = UBXReader(SerialStandIn(parts), protfilter=UBX_PROTOCOL, quitonerror=ERR_IGNORE)
        return [message for _, message in reader if message is not None]

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return (decoded.identity, decoded.payload)
