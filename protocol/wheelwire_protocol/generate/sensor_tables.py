"""The firmware's header about peripherals: the packed entry, and how to use each chip."""

from __future__ import annotations

from ..board_layout import PERIPHERAL_SIZE, Peripheral
from ..codes import FRONT_PLACES, MOST_PERIPHERALS, REAR_PLACES
from ..message import fields_of
from ..peripherals import (
    IMUS,
    MAX_SHUNT_UOHM,
    MOST_ANALOG,
    MOST_RANGES,
    POWERS,
    RANGES,
    ImuTable,
    Order,
)
from .cpp import cpp_header, cpp_is_one_of, cpp_struct
from .cpp_tables import cpp_table
from .text import lines

_IMU = """
SensorChip chip
uint8_t address:02x With its address pin low.
uint8_t identity_register:02x
uint8_t identities[2]:02x It holds one of them.
uint8_t setup_count
RegisterWrite setup[{most_writes}]:02x
uint8_t check_register:02x Reads check_value as long as the chip has its settings.
uint8_t check_value:02x
uint8_t data_register:02x The first of the bytes that are read at once.
bool is_big_endian
uint8_t gyro Where its x is in them.
uint8_t accelerometer Where its x is in them.
uint8_t temperature Where it is in them.
uint8_t size How many are read.
float gyro_radps Of one count.
float accelerometer_mps2 Of one count.
int16_t temperature_offset_cdeg
float temperature_counts For one degree.
float gyro_noise Standard deviation, counts.
float accelerometer_noise Standard deviation, counts.
uint16_t rate_hz Samples per second, as set up.
uint8_t frozen_samples So many equal ones in a row: it no longer measures.
"""
_POWER = """
SensorChip chip
uint8_t address:02x With its address pins low.
uint16_t setup:04x Of register 0.
uint8_t identity_register:02x
uint16_t identity:04x
uint8_t bus_register
uint8_t bus_shift
uint16_t bus_uv Of one count.
uint16_t shunt_nv Of one count of register 1.
"""
_RANGE = """
SensorChip chip
uint32_t trigger_us A high level of this length starts a measurement.
uint32_t start_us Its echo output rises within this, or it is absent.
uint32_t nothing_us A pulse of this length: nothing reflected the sound.
uint32_t period_us From one trigger to the next at least.
float um_per_us Distance for the length of the pulse.
uint16_t nearest_mm
uint16_t farthest_mm
"""


def _two_identities(table: ImuTable) -> tuple[int, int]:
    # As many as the struct holds; a third one fails here.
    first, *more = table.identities
    (second,) = more or [first]
    return first, second


def generate() -> str:
    """The text of `sensor_tables.hpp`."""
    most_writes = max(len(table.setup) for table in IMUS.values())
    constants = f"""\
/// Entries of a list. A channel is the index of an entry.
constexpr size_t kMostPeripherals = {MOST_PERIPHERALS};
/// Analogue inputs of a list. Each has a number of its own, from 1.
constexpr size_t kMostAnalog = {MOST_ANALOG};
/// Range sensors of a list.
constexpr size_t kMostRanges = {MOST_RANGES};
/// In steps of 100 uOhm.
constexpr uint16_t kLargestShunt = {MAX_SHUNT_UOHM // 100};

/// A peripheral as it is sent and stored. Fields that are codes may be unknown ones."""
    size = f"static constexpr size_t kSize = {PERIPHERAL_SIZE};"
    parts = (
        lines(
            (constants, cpp_struct("Peripheral", "entry", fields_of(Peripheral), size, pin="-1"))
        ),
        cpp_is_one_of(
            "is_front(Place place)", "A bumper there forbids driving forward.", FRONT_PLACES
        ),
        cpp_is_one_of(
            "is_rear(Place place)", "A bumper there forbids driving backward.", REAR_PLACES
        ),
        "struct RegisterWrite {\nuint8_t at;\nuint8_t value;\n};",
        cpp_table(
            "ImuTable",
            "How to use an IMU.",
            _IMU.format(most_writes=most_writes),
            IMUS,
            identities=_two_identities,
            setup_count=lambda table: len(table.setup),
            is_big_endian=lambda table: table.order is Order.BIG,
        ),
        cpp_table(
            "PowerTable",
            "How to use a power sensor. Its registers have 16 bits, the high byte first.",
            _POWER,
            POWERS,
        ),
        cpp_table("RangeTable", "How to use a range sensor.", _RANGE, RANGES),
    )
    return cpp_header("Peripherals", '#include "protocol.hpp"', parts)
