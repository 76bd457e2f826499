"""The packed struct in which a board travels and is kept: its only definition."""

from __future__ import annotations

from construct import Bytes, Int8sl, Int8ul, Int16ul, Int32ul, Int64ul, Struct

from .board import NAME_SIZE, PIN_FUNCTIONS, BoardLine, ContactKind, EncoderPulls, Module, Stage
from .codes import Board
from .message import Field, field
from .units import Unit


def _pin(name: str) -> Field:
    return field(name, Int8sl, Unit.NONE, "GPIO; -1: none.")


def board_fields() -> list[Field]:
    """The packed struct's fields, in order."""
    return [
        field("version", Int8ul, Unit.NONE, "Of this struct."),
        field("chip", Int8ul, Unit.NONE, "The chip whose pins these are.", Board),
        field("module", Int8ul, Unit.NONE, "What carries the chip.", Module),
        field("stage", Int8ul, Unit.NONE, "The power stage of both wheels.", Stage),
        field("line", Int8ul, Unit.NONE, "The line to the host.", BoardLine),
        field("name", Bytes(NAME_SIZE), Unit.NONE, "ASCII, filled up with zeros."),
        *map(_pin, PIN_FUNCTIONS),
        field("encoder_pulls", Int8ul, Unit.NONE, "Of all four encoder inputs.", EncoderPulls),
        field("estop_contact", Int8ul, Unit.NONE, "What a press does.", ContactKind),
        field("pwm_frequency_hz", Int16ul, Unit.HERTZ, "Default of the parameter of this name."),
        field("encoder_filter_ns", Int16ul, Unit.NANOSECOND, "Default of glitch_filter_ns."),
        field(
            "battery_divider_permille",
            Int16ul,
            Unit.NONE,
            "Battery volts per volt at the pin, times 1000.",
        ),
        # 64 bits, because the GPIOs of an ESP32-S3 go up to 48.
        field("pulldowns", Int64ul, Unit.NONE, "GPIOs with an external pull-down, as bits."),
        field("crc", Int32ul, Unit.NONE, "CRC-32 of the bytes before it, as in a frame."),
    ]


BOARD = Struct(*board_fields())
BOARD_SIZE: int = BOARD.sizeof()
