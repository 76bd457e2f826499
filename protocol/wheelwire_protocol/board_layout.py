"""How a board and its peripherals are sent and stored: parts of several messages."""

from __future__ import annotations

from construct import Struct

from .board import NAME_SIZE, PIN_FUNCTIONS, BoardLine, ContactKind, EncoderPulls, Module
from .codes import Chip, PeripheralKind, Place, Unit
from .message import Definition, chars, fields_of, i8, u8, u16, u64
from .peripherals import Axis, PeripheralFlag, SensorChip
from .power_stages import Stage


class Board(Definition):
    """The packed struct in which a board is sent and stored."""

    version = u8("Of this layout.")
    chip = u8(codes=Chip)
    module = u8(codes=Module)
    stage = u8("Of both wheels.", Stage)
    line = u8(codes=BoardLine)
    name = chars(NAME_SIZE, "ASCII.")
    pins = tuple(i8("GPIO; -1: none.", name=pin) for pin in PIN_FUNCTIONS)
    encoder_pulls = u8(codes=EncoderPulls)
    estop_contact = u8(codes=ContactKind)
    pwm_frequency_hz = u16("Default of this parameter.", unit=Unit.HERTZ)
    encoder_filter_ns = u16("Default of glitch_filter_ns.", unit=Unit.NANOSECOND)
    battery_divider_permille = u16("Battery voltage / pin voltage x 1000.")
    # 64 bits, because the GPIOs of an ESP32-S3 go up to 48.
    pulldowns = u64("Bit n: GPIO n has an external pull-down.")


class Peripheral(Definition):
    """The packed struct in which one peripheral is sent and stored."""

    kind = u8(codes=PeripheralKind)
    chip = u8("Of an IMU, POWER or RANGE.", SensorChip)
    place = u8(codes=Place)
    flags = u8(codes=PeripheralFlag)
    pin_a = i8("GPIO; -1: none.")
    pin_b = i8("GPIO; -1: none.")
    pin_c = i8("GPIO; -1: none.")
    address = u8("On the I2C bus; 0: the chip's default.")
    forward = u8(codes=Axis)
    up = u8(codes=Axis)
    value_a = u16("By kind: see SPEC.md.")
    value_b = u16("By kind: see SPEC.md.")
    value_c = u16("By kind: see SPEC.md.")


def size_of(packed: type[Definition]) -> int:
    """The bytes of a packed struct."""
    size: int = Struct(*fields_of(packed)).sizeof()
    return size


BOARD_SIZE, PERIPHERAL_SIZE = size_of(Board), size_of(Peripheral)
