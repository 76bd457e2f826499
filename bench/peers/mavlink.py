"""pymavlink: MAVLink 2 with its GENERATOR_STATUS, 42 bytes in 11 numbers (ours: 39 in 13)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from wheelwire_protocol.types import WheelState

from .base import Peer

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import common  # the version is read at import


class Pymavlink(Peer):
    """The message is of equal weight, as MAVLink has its own; the parser is set to go on."""

    name = "pymavlink"
    distribution = "pymavlink"
    remark = "CRC-16; 11 numbers"

    def __init__(self) -> None:
        if common.mcrf4xx is None:
            raise RuntimeError("pymavlink runs without fastcrc, an unfair peer")
        self._sender = common.MAVLink(None, srcSystem=1, srcComponent=1)

    def fields(self, state: WheelState) -> dict[str, Any]:
        return {
            "status": state.boot_id,
            "generator_speed": state.battery_mv,
            "battery_current": state.left_mps,
            "load_current": state.right_mps,
            "power_generated": float(state.command_seq),
            "bus_voltage": float(state.battery_mv),
            "rectifier_temperature": state.left_duty_q15,
            "bat_current_setpoint": float(state.overruns),
            "generator_temperature": state.right_duty_q15,
            "runtime": state.t_us,
            "time_until_maintenance": state.right_ticks,
        }

    def encode(self, fields: Any) -> bytes:
        message = common.MAVLink_generator_status_message(**fields)
        return bytes(message.pack(self._sender))

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        parser = common.MAVLink(None)
        parser.robust_parsing = True
        return [
            message
            for part in parts
            for message in parser.parse_buffer(part) or ()
            if message.get_msgId() >= 0  # below: bytes that were no frame
        ]

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(decoded.to_dict().values())
