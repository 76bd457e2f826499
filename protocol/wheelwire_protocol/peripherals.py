"""A board's peripherals: their codes, what is wrong with a list, and the chips' registers.

A board's *peripherals* are a list of entries of fixed size, stored beside the board and bound to
its fingerprint. The packed entry is in `messages`. The firmware's `core/peripherals.hpp` has the
rules for lists; each rule has its sentence in `PeripheralFault`.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from . import codes

MOST_ANALOG = 4
"""Analogue inputs of a list. Each has a number of its own, from 1."""
MOST_RANGES = 3
"""Range sensors of a list: as many as the capture unit of each supported chip has channels."""


class SensorChip(codes.DocumentedEnum):
    """The chip of an IMU or of a power sensor, or the part that measures a range."""

    NONE = 0, "Not a chip."
    MPU6050 = 1, "InvenSense MPU-6050, as on the GY-521."
    MPU6500 = 2, "InvenSense MPU-6500."
    MPU9250 = 3, "InvenSense MPU-9250, without its magnetometer."
    LSM6DS3 = 4, "ST LSM6DS3."
    INA219 = 5, "TI INA219."
    INA226 = 6, "TI INA226."
    LSM6DS3TR_C = 7, "ST LSM6DS3TR-C."
    HC_SR04 = 8, "HC-SR04, an ultrasonic range sensor."


class Axis(codes.DocumentedEnum):
    """An axis of the sensor's chip, as printed on its board."""

    X = 0, "+x"
    Y = 1, "+y"
    Z = 2, "+z"
    MINUS_X = 3, "-x"
    MINUS_Y = 4, "-y"
    MINUS_Z = 5, "-z"


class PeripheralFlag(codes.DocumentedFlag):
    """Flags of an entry."""

    TRIGGERED_LOW = 1, "A digital input triggers at the low level; otherwise at the high one."
    PULL_UP = 2, "The chip's own pull-up holds the pin."
    PULL_DOWN = 4, "The chip's own pull-down holds the pin."


class PeripheralFault(codes.DocumentedEnum):
    """Why a list is refused. `{entry}` is its number, from 1; `{pin}` a GPIO."""

    NONE = 0, "Nothing is wrong."
    TOO_MANY = 4, "{value} entries: a board takes {limit} at most"
    KIND = 5, "{entry}: the firmware does not know this kind of peripheral: update it"
    CHIP = 6, "{entry}: chip: the firmware does not know this chip for this kind"
    PLACE = (
        7,
        "{entry}: place: a bumper is at the front or at the rear, a range sensor at a side, too; "
        "name where",
    )
    TWICE = (
        8,
        "{entry}: there is already one of this kind at this place, with this number, or with this "
        "address on its bus; remove one, or give it another address",
    )
    PIN_MISSING = 9, "{entry}: a pin is missing: name each that it has"
    PIN_ABSENT = 10, "{entry}: {pin}: the chip has no GPIO {pin} on its pins"
    PIN_TAKEN = 11, "{entry}: {pin}: GPIO {pin} is in use already; choose a free one"
    PIN_OF_MEMORY = (
        12,
        "{entry}: {pin}: GPIO {pin} leads to flash or PSRAM, on some modules at least; choose "
        "another, or name the module",
    )
    PIN_OF_LINK = 13, "{entry}: {pin}: GPIO {pin} carries the line to the computer; choose another"
    PIN_STRAPPING = (
        14,
        "{entry}: {pin}: the level of GPIO {pin} at reset selects how the chip starts; "
        "choose another",
    )
    PIN_INPUT_ONLY = 15, "{entry}: {pin}: GPIO {pin} is an input only; this one is driven"
    NO_PULL = (
        16,
        "{entry}: {pin}: GPIO {pin} cannot hold it as this input needs; fit 10 kOhm to 3.3 V and "
        "write `pull: external`, or choose another",
    )
    ORIENTATION = 17, "{entry}: forward and up: choose two different axes"
    LEVELS = (
        18,
        "{entry}: the levels must fall: warn_v above limit_v above stop_v above 0; leave all "
        "three out to measure only",
    )
    NO_BATTERY = 19, "{entry}: the board has no battery divider, and the list no power sensor"
    SHUNT = 20, "{entry}: shunt_mohm rounds to 0: choose 0.1 to {limit}"
    CODE = 21, "{entry}: the firmware does not know one of its codes: update it"
    NORMALLY_OPEN = (
        22,
        "{entry}: use a normally closed switch, so that a broken wire counts as pressed",
    )
    NOT_ON_THIS_CHIP = 23, "{entry}: the chip of this board cannot read it, an ESP32 can"
    NO_ADC = 24, "{entry}: {pin}: GPIO {pin} cannot measure a voltage; choose one of ADC1"
    DIVIDER = 25, "{entry}: divider = {value} thousandths: choose 1000 to {limit}"
    TOO_MANY_RANGES = 26, "{entry}: this chip times {limit} echoes at most; remove a range sensor"
    BUS = (
        27,
        "{entry}: an ESP32's bus has two pins, sda and scl; a computer's has a number, bus: name "
        "it as this board's chip has it",
    )


# Their names and values are part of the hashes of both groups.
PERIPHERAL_CODES: tuple[type[codes.DocumentedEnum], ...] = (
    codes.PeripheralKind,
    SensorChip,
    codes.Place,
    Axis,
    PeripheralFault,
)
"""The codes of a configuration's peripherals."""
CODES: tuple[type[codes.DocumentedEnum], ...] = (
    *PERIPHERAL_CODES,
    codes.SensorState,
    codes.RangeQuality,
    codes.BatteryLevel,
    codes.SensorEventCode,
)
"""The codes of the group SENSOR."""
FLAGS: tuple[type[codes.DocumentedFlag], ...] = (PeripheralFlag, codes.Reflex)
MAX_SHUNT_UOHM = 6_553_500
"""The largest shunt that an entry can name: 65535 x 100 uOhm."""


class Order(enum.Enum):
    """How a chip sends a 16-bit number."""

    BIG = enum.auto()
    LITTLE = enum.auto()


class ImuTable(NamedTuple):
    """How to use one IMU. Figures are those of the chip's data sheet.

    Attributes:
        address: On the bus, with its address pin low; high is one more.
        identity_register: Holds one of `identities`. Chips that have it at the same address are
            sold for each other: one is used by its own table, whichever the board's file names.
        setup: Registers and the values to write to them, in order.
        check_register: Reads `check_value` as long as the chip has its settings.
        data_register: The first of the bytes that are read at once.
        order: Order of the bytes of a number.
        gyro: Where x of the gyroscope is in them, in bytes; y and z follow.
        accelerometer: As `gyro`.
        temperature: As `gyro`, one number.
        size: How many bytes are read.
        gyro_radps: Radians per second of one count.
        accelerometer_mps2: m/s^2 of one count.
        temperature_offset_cdeg: Hundredths of a degree Celsius at 0 counts.
        temperature_counts: Counts for one degree.
        gyro_noise: Standard deviation at the rates set up, in counts.
        accelerometer_noise: As `gyro_noise`.
        rate_hz: Samples per second, as set up.
        frozen_samples: So many equal raw samples in a row mean that the chip no longer measures.
    """

    address: int
    identity_register: int
    identities: tuple[int, ...]
    setup: tuple[tuple[int, int], ...]
    check_register: int
    check_value: int
    data_register: int
    order: Order
    gyro: int
    accelerometer: int
    temperature: int
    size: int
    gyro_radps: float
    accelerometer_mps2: float
    temperature_offset_cdeg: int
    temperature_counts: float
    gyro_noise: float
    accelerometer_noise: float
    rate_hz: int
    frozen_samples: int


_RADIAN = 0.017453292519943295
_GRAVITY = 9.80665

# All are set to 500 deg/s and 4 g, with a low-pass filter of some 40 Hz.
_MPU: dict[str, Any] = {
    "address": 0x68,
    "identity_register": 0x75,
    "data_register": 0x3B,
    "order": Order.BIG,
    "accelerometer": 0,
    "temperature": 6,
    "gyro": 8,
    "size": 14,
    "gyro_radps": _RADIAN / 65.5,
    "accelerometer_mps2": _GRAVITY / 8192,
    "check_register": 0x1B,
    "check_value": 0x08,
    "rate_hz": 200,
    "frozen_samples": 4,
}

# As the MPU-6050, with the accelerometer's filter in a register of its own.
_MPU6500: dict[str, Any] = {
    **_MPU,
    "setup": ((0x6B, 1), (0x1A, 3), (0x1B, 8), (0x1C, 8), (0x1D, 3), (0x19, 4), (0x38, 1)),
    "temperature_offset_cdeg": 2100,
    "temperature_counts": 333.87,
    "gyro_noise": 4.1,
    "accelerometer_noise": 15.5,
}

# CTRL1_XL: 208 Hz, 4 g; CTRL2_G: 208 Hz, 500 deg/s; CTRL3_C: block update, increment; INT1_CTRL:
# data ready of the gyroscope.
_LSM6: dict[str, Any] = {
    "address": 0x6A,
    "identity_register": 0x0F,
    "setup": ((0x12, 0x44), (0x10, 0x58), (0x11, 0x54), (0x0D, 0x02)),
    "check_register": 0x11,
    "check_value": 0x54,
    "data_register": 0x20,
    "order": Order.LITTLE,
    "temperature": 0,
    "gyro": 2,
    "accelerometer": 8,
    "size": 14,
    "gyro_radps": _RADIAN * 0.0175,
    "accelerometer_mps2": _GRAVITY * 0.000122,
    "temperature_offset_cdeg": 2500,
    "gyro_noise": 2.8,
    "accelerometer_noise": 7.5,
    "rate_hz": 208,
    "frozen_samples": 4,
}

IMUS: Mapping[SensorChip, ImuTable] = MappingProxyType(
    {
        # PWR_MGMT_1: clock of the x gyroscope; CONFIG: filter; then the two ranges; SMPLRT_DIV;
        # INT_ENABLE: data ready.
        SensorChip.MPU6050: ImuTable(
            identities=(0x68, 0x72),  # 0x72: a copy
            setup=((0x6B, 0x01), (0x1A, 0x03), (0x1B, 0x08), (0x1C, 0x08), (0x19, 4), (0x38, 1)),
            temperature_offset_cdeg=3653,
            temperature_counts=340.0,
            gyro_noise=2.1,
            accelerometer_noise=20.7,
            **_MPU,
        ),
        # 0x98: an ICM-20689, of the same registers; its thermometer shows 4 degrees too little.
        SensorChip.MPU6500: ImuTable(identities=(0x70, 0x98), **_MPU6500),
        SensorChip.MPU9250: ImuTable(identities=(0x71, 0x73), **_MPU6500),
        SensorChip.LSM6DS3: ImuTable(identities=(0x69,), temperature_counts=16.0, **_LSM6),
        SensorChip.LSM6DS3TR_C: ImuTable(identities=(0x6A,), temperature_counts=256.0, **_LSM6),
    }
)
"""The IMUs' tables by SensorChip."""


class PowerTable(NamedTuple):
    """How to use one power sensor. Figures are those of the chip's data sheet.

    Attributes:
        address: On the bus, with its address pins low.
        setup: The 16-bit value of the configuration register, 0.
        identity_register: Holds `identity`; -1: the chip has none, the configuration is read.
        identity: What it holds.
        bus_register: Register of the voltage.
        bus_shift: How far its counts are shifted to the left.
        bus_uv: Microvolts of one count.
        shunt_nv: Nanovolts of one count of the shunt's voltage, register 1.
    """

    address: int
    setup: int
    identity_register: int
    identity: int
    bus_register: int
    bus_shift: int
    bus_uv: int
    shunt_nv: int


POWERS: Mapping[SensorChip, PowerTable] = MappingProxyType(
    {
        # 32 V, 320 mV, 12 bits, 8 samples, continuous.
        SensorChip.INA219: PowerTable(
            address=0x40,
            setup=0x3DDF,
            identity_register=0,
            identity=0x3DDF,
            bus_register=2,
            bus_shift=3,
            bus_uv=4000,
            shunt_nv=10_000,
        ),
        # 16 samples of 1.1 ms, continuous.
        SensorChip.INA226: PowerTable(
            address=0x40,
            setup=0x4527,
            identity_register=0xFE,
            identity=0x5449,
            bus_register=2,
            bus_shift=0,
            bus_uv=1250,
            shunt_nv=2500,
        ),
    }
)
"""The power sensors' tables by SensorChip."""


class RangeTable(NamedTuple):
    """How to use one range sensor. Figures are those of the part's data sheet.

    Attributes:
        trigger_us: A high level of this length at its trigger starts a measurement.
        start_us: Its echo output rises within this, or the part is absent.
        nothing_us: An echo pulse of this length or more means that nothing reflected the sound.
        period_us: From one trigger to the next at least: the earlier sound has faded.
        um_per_us: Distance for the pulse's length: half of the speed of sound at 20 deg C.
        nearest_mm: What is nearer is not measured.
        farthest_mm: What is farther is not measured.
        cone_rad: Full width of the cone in which it sees something.
    """

    trigger_us: int
    start_us: int
    nothing_us: int
    period_us: int
    um_per_us: float
    nearest_mm: int
    farthest_mm: int
    cone_rad: float


RANGES: Mapping[SensorChip, RangeTable] = MappingProxyType(
    {
        # Its burst of eight periods of 40 kHz comes before the echo output rises. Without an
        # echo the pulse has 38 ms, and some makers' parts hold it longer.
        SensorChip.HC_SR04: RangeTable(
            trigger_us=10,
            start_us=2000,
            nothing_us=30_000,
            period_us=60_000,
            um_per_us=171.5,
            nearest_mm=20,
            farthest_mm=4000,
            cone_rad=0.26,
        ),
    }
)
"""The range sensors' tables by SensorChip."""
