"""The firmware's header about peripherals: the packed entry, and how to use each chip."""

from __future__ import annotations

from ..messages import PERIPHERAL_SIZE, peripheral_fields
from ..sensors import (
    FRONT_PLACES,
    IMUS,
    MAX_SHUNT_UOHM,
    MOST_ANALOG,
    MOST_PERIPHERALS,
    MOST_RANGES,
    POWERS,
    RANGES,
    REAR_PLACES,
    ImuTable,
    Order,
    Place,
    PowerTable,
    RangeTable,
    SensorChip,
)
from .cpp import cpp_codec, cpp_member, cpp_number
from .text import banner, constant_name


def _struct() -> list[str]:
    fields = peripheral_fields()
    return [
        "/// A peripheral as it is sent and stored. Fields that are codes may be unknown ones.",
        "struct Peripheral {",
        f"  static constexpr size_t kSize = {PERIPHERAL_SIZE};",
        "",
        *[cpp_member(f, "-1" if f.format == "b" else "") for f in fields],
        "",
        *cpp_codec("Peripheral", "entry", fields),
    ]


def _imu_row(chip: SensorChip, table: ImuTable) -> str:
    writes = ", ".join(f"{{0x{at:02x}, 0x{value:02x}}}" for at, value in table.setup)
    identities = (*table.identities, table.identities[-1])[:2]
    cells = [
        f"SensorChip::{constant_name(chip.name)}",
        f"0x{table.address:02x}",
        f"0x{table.identity_register:02x}",
        "{" + ", ".join(f"0x{i:02x}" for i in identities) + "}",
        str(len(table.setup)),
        "{" + writes + "}",
        f"0x{table.check_register:02x}",
        f"0x{table.check_value:02x}",
        f"0x{table.data_register:02x}",
        str(table.order is Order.BIG).lower(),
        str(table.gyro),
        str(table.accelerometer),
        str(table.temperature),
        str(table.size),
        cpp_number(table.gyro_radps),
        cpp_number(table.accelerometer_mps2),
        str(table.temperature_offset_cdeg),
        cpp_number(table.temperature_counts),
        cpp_number(table.gyro_noise),
        cpp_number(table.accelerometer_noise),
        str(table.rate_hz),
        str(table.frozen_samples),
    ]
    return "    {" + ", ".join(cells) + "},"


def _power_row(chip: SensorChip, table: PowerTable) -> str:
    cells = (
        f"SensorChip::{constant_name(chip.name)}",
        f"0x{table.address:02x}",
        f"0x{table.setup:04x}",
        f"0x{table.identity_register:02x}",
        f"0x{table.identity:04x}",
        str(table.bus_register),
        str(table.bus_shift),
        str(table.bus_uv),
        str(table.shunt_nv),
    )
    return "    {" + ", ".join(cells) + "},"


def _range_row(chip: SensorChip, table: RangeTable) -> str:
    cells = (
        f"SensorChip::{constant_name(chip.name)}",
        str(table.trigger_us),
        str(table.start_us),
        str(table.nothing_us),
        str(table.period_us),
        cpp_number(table.um_per_us),
        str(table.nearest_mm),
        str(table.farthest_mm),
    )
    return "    {" + ", ".join(cells) + "},"


def _is_one_of(name: str, doc: str, places: tuple[Place, ...]) -> list[str]:
    tests = " || ".join(f"place == Place::{constant_name(place.name)}" for place in places)
    return [f"/// {doc}", f"constexpr bool {name}(Place place) {{", f"  return {tests};", "}", ""]


def generate() -> str:
    """The text of `sensor_tables.hpp`."""
    most_writes = max(len(table.setup) for table in IMUS.values())
    lines = [
        f"// {banner('Peripherals')}",
        "#pragma once",
        "",
        '#include "protocol.hpp"',
        "",
        "namespace wheelwire {",
        "",
        "/// Entries of a list. A channel is the index of an entry.",
        f"constexpr size_t kMostPeripherals = {MOST_PERIPHERALS};",
        "/// Analogue inputs of a list. Each has a number of its own, from 1.",
        f"constexpr size_t kMostAnalog = {MOST_ANALOG};",
        "/// Range sensors of a list.",
        f"constexpr size_t kMostRanges = {MOST_RANGES};",
        "/// In steps of 100 uOhm.",
        f"constexpr uint16_t kLargestShunt = {MAX_SHUNT_UOHM // 100};",
        "",
        *_struct(),
        *_is_one_of("is_front", "A bumper there forbids driving forward.", FRONT_PLACES),
        *_is_one_of("is_rear", "A bumper there forbids driving backward.", REAR_PLACES),
        "struct RegisterWrite {",
        "  uint8_t at;",
        "  uint8_t value;",
        "};",
        "",
        "/// How to use an IMU.",
        "struct ImuTable {",
        "  SensorChip chip;",
        "  uint8_t address;  ///< With its address pin low.",
        "  uint8_t identity_register;",
        "  uint8_t identities[2];  ///< It holds one of them.",
        "  uint8_t setup_count;",
        f"  RegisterWrite setup[{most_writes}];",
        "  uint8_t check_register;  ///< Reads check_value as long as the chip has its settings.",
        "  uint8_t check_value;",
        "  uint8_t data_register;  ///< The first of the bytes that are read at once.",
        "  bool is_big_endian;",
        "  uint8_t gyro;           ///< Where its x is in them.",
        "  uint8_t accelerometer;  ///< Where its x is in them.",
        "  uint8_t temperature;    ///< Where it is in them.",
        "  uint8_t size;           ///< How many are read.",
        "  float gyro_radps;       ///< Of one count.",
        "  float accelerometer_mps2;  ///< Of one count.",
        "  int16_t temperature_offset_cdeg;",
        "  float temperature_counts;   ///< For one degree.",
        "  float gyro_noise;           ///< Standard deviation, counts.",
        "  float accelerometer_noise;  ///< Standard deviation, counts.",
        "  uint16_t rate_hz;           ///< Samples per second, as set up.",
        "  uint8_t frozen_samples;     ///< So many equal ones in a row: it no longer measures.",
        "};",
        "",
        "constexpr ImuTable kImuTables[] = {",
        *(_imu_row(chip, table) for chip, table in IMUS.items()),
        "};",
        "",
        "/// How to use a power sensor. Its registers have 16 bits, the high byte first.",
        "struct PowerTable {",
        "  SensorChip chip;",
        "  uint8_t address;  ///< With its address pins low.",
        "  uint16_t setup;   ///< Of register 0.",
        "  uint8_t identity_register;",
        "  uint16_t identity;",
        "  uint8_t bus_register;",
        "  uint8_t bus_shift;",
        "  uint16_t bus_uv;    ///< Of one count.",
        "  uint16_t shunt_nv;  ///< Of one count of register 1.",
        "};",
        "",
        "constexpr PowerTable kPowerTables[] = {",
        *(_power_row(chip, table) for chip, table in POWERS.items()),
        "};",
        "",
        "/// How to use a range sensor.",
        "struct RangeTable {",
        "  SensorChip chip;",
        "  uint32_t trigger_us;  ///< A high level of this length starts a measurement.",
        "  uint32_t start_us;    ///< Its echo output rises within this, or it is absent.",
        "  uint32_t nothing_us;  ///< A pulse of this length: nothing reflected the sound.",
        "  uint32_t period_us;   ///< From one trigger to the next at least.",
        "  float um_per_us;      ///< Distance for the length of the pulse.",
        "  uint16_t nearest_mm;",
        "  uint16_t farthest_mm;",
        "};",
        "",
        "constexpr RangeTable kRangeTables[] = {",
        *(_range_row(chip, table) for chip, table in RANGES.items()),
        "};",
        "",
        "}  // namespace wheelwire",
        "",
    ]
    return "\n".join(lines)
