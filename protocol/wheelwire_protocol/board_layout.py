"""How a board and its peripherals are sent and stored: parts of several messages."""

from __future__ import annotations

from construct import Struct

from .board import NAME_SIZE, PIN_FUNCTIONS, BoardLine, ContactKind, EncoderPulls, Module
from .codes import Chip, PeripheralKind, Place, Unit
from .message import Field, chars, i8, u8, u16, u64
from .peripherals import Axis, PeripheralFlag, SensorChip
from .power_stages import Stage


def _pin(name: str) -> Field:
    return i8(name, "GPIO; -1: none.")


def board_fields() -> list[Field]:
    """The packed struct in which a board is sent and stored: its fields, in order."""
    return [
        u8("version", "Of this layout."),
        u8("chip", codes=Chip),
        u8("module", codes=Module),
        u8("stage", "Of both wheels.", Stage),
        u8("line", codes=BoardLine),
        chars(NAME_SIZE, "name", "ASCII."),
        *map(_pin, PIN_FUNCTIONS),
        u8("encoder_pulls", codes=EncoderPulls),
        u8("estop_contact", codes=ContactKind),
        u16("pwm_frequency_hz", "Default of this parameter.", unit=Unit.HERTZ),
        u16("encoder_filter_ns", "Default of glitch_filter_ns.", unit=Unit.NANOSECOND),
        u16("battery_divider_permille", "Battery voltage / pin voltage x 1000."),
        # 64 bits, because the GPIOs of an ESP32-S3 go up to 48.
        u64("pulldowns", "Bit n: GPIO n has an external pull-down."),
    ]


BOARD = Struct(*board_fields())
BOARD_SIZE: int = BOARD.sizeof()


def peripheral_fields() -> list[Field]:
    """The packed struct in which one peripheral is sent and stored: its fields, in order."""
    return [
        u8("kind", codes=PeripheralKind),
        u8("chip", "Of an IMU, POWER or RANGE.", SensorChip),
        u8("place", codes=Place),
        u8("flags", codes=PeripheralFlag),
        _pin("pin_a"),
        _pin("pin_b"),
        _pin("pin_c"),
        u8("address", "On the I2C bus; 0: the chip's default."),
        u8("forward", codes=Axis),
        u8("up", codes=Axis),
        u16("value_a", "By kind: see SPEC.md."),
        u16("value_b", "By kind: see SPEC.md."),
        u16("value_c", "By kind: see SPEC.md."),
    ]


PERIPHERAL_SIZE: int = Struct(*peripheral_fields()).sizeof()
