"""A board: which pins of which chip are wired to which power stage and encoders.

What host and firmware must agree on about boards: the codes, and what each chip's pins can do. The
packed struct is in `messages`. The core's `core/board_rules.hpp` has the rules for boards; each has
its sentence in `BoardFault`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from .codes import Chip, ConfigurationState, DocumentedEnum
from .power_stages import Stage

BOARD_VERSION = 1
"""Version of the packed struct. A device refuses any other."""
NAME_SIZE = 24


class EncoderPulls(DocumentedEnum):
    """What holds an encoder's outputs high."""

    INTERNAL = 0, "The chip's own pull-ups."
    EXTERNAL = 1, "Resistors on the board, or outputs that drive both levels."


class ContactKind(DocumentedEnum):
    """What the e-stop contact does when it is pressed."""

    NORMALLY_CLOSED = 0, "It opens; a broken wire is an e-stop, too."
    NORMALLY_OPEN = 1, "It closes to ground; a broken wire goes unnoticed."


class BoardLine(DocumentedEnum):
    """The line to the host."""

    UART = 0, "UART0, through the board's USB bridge."
    USB = 1, "The chip's own USB."


class Module(DocumentedEnum):
    """What carries the chip: it decides which pins flash and PSRAM take."""

    ANY = 0, "Not named: the pins that any module needs for its memory stay free."
    WROOM_32 = 1, "ESP32-WROOM-32, -32D, -32E, -32U: no PSRAM; GPIO 16 and 17 are free."
    WROVER = 2, "ESP32-WROVER: GPIO 16 and 17 lead to its PSRAM."
    S3_QUAD = 3, "An ESP32-S3 module with quad flash and quad or no PSRAM, as N8 and N8R2."
    S3_OCTAL = 4, "An ESP32-S3 module with octal PSRAM or flash, as N8R8: it takes GPIO 33 to 37."


class BoardPin(DocumentedEnum):
    """The functions that a board gives to pins, with the names that users are shown."""

    # Each wheel's stage inputs are consecutive, in the order of OUTPUTS: the core finds an input by
    # its distance from the first one.
    LEFT_ENABLE = 0, "left.enable"
    LEFT_IN1 = 1, "left.in1"
    LEFT_IN2 = 2, "left.in2"
    LEFT_PWM = 3, "left.pwm"
    LEFT_DIR = 4, "left.dir"
    LEFT_ENCODER_A = 5, "left.encoder_a"
    LEFT_ENCODER_B = 6, "left.encoder_b"
    RIGHT_ENABLE = 7, "right.enable"
    RIGHT_IN1 = 8, "right.in1"
    RIGHT_IN2 = 9, "right.in2"
    RIGHT_PWM = 10, "right.pwm"
    RIGHT_DIR = 11, "right.dir"
    RIGHT_ENCODER_A = 12, "right.encoder_a"
    RIGHT_ENCODER_B = 13, "right.encoder_b"
    STANDBY = 14, "standby"
    ESTOP = 15, "estop.pin"
    BATTERY = 16, "battery.pin"
    LED = 17, "led"


class BoardFault(DocumentedEnum):
    """Why a board is refused. `{pin}` is a GPIO, `{function}` what the board uses it for."""

    NONE = 0, "Nothing is wrong."
    VERSION = 1, "its format is version {value}, this firmware knows {limit}: update the older one"
    DAMAGED = 2, "its checksum is wrong: write it again"
    NAME = 3, "name: give it 1 to 24 printable ASCII characters"
    CHIP = 4, "chip: no such chip is known"
    OTHER_CHIP = 5, "chip: it is for {chip}, this device is another one"
    STAGE = 6, "stage: no such power stage is known"
    PIN_MISSING = 7, "{function}: the stage {stage} needs this pin"
    PIN_WITHOUT_USE = 8, "{function} = {pin}: the stage {stage} has no such input; leave it out"
    PIN_ABSENT = 9, "{function} = {pin}: {chip} has no GPIO {pin} on its pins"
    PIN_TWICE = 10, "{function} = {pin}: GPIO {pin} is {other} already; choose a free one"
    PIN_OF_MEMORY = (
        11,
        "{function} = {pin}: GPIO {pin} of {chip} leads to its flash or PSRAM, on some modules at "
        "least; choose another, or name the module",
    )
    PIN_OF_LINK = (
        12,
        "{function} = {pin}: GPIO {pin} of {chip} carries the line to the computer; choose another",
    )
    PIN_STRAPPING = (
        13,
        "{function} = {pin}: the level of GPIO {pin} at reset selects how {chip} starts; "
        "choose another",
    )
    PIN_INPUT_ONLY = (
        14,
        "{function} = {pin}: GPIO {pin} of {chip} is an input only; choose one that can drive",
    )
    NO_PULL_UP = (
        15,
        "{function} = {pin}: GPIO {pin} of {chip} has no pull-up of its own, so an open wire "
        "counts ticks; choose another, or fit resistors to 3.3 V and write "
        "`encoder_pulls: external`",
    )
    NO_PULL_UP_FOR_CONTACT = (
        16,
        "{function} = {pin}: GPIO {pin} of {chip} has no pull-up, so an open contact reads as "
        "nothing; choose another",
    )
    NO_ADC = 17, "{function} = {pin}: GPIO {pin} of {chip} cannot measure; choose one of ADC1"
    NOT_ON_THIS_CHIP = 18, "{function} = {pin}: {chip} has no support for it; leave it out"
    NO_PULL_DOWN = (
        19,
        "{function} = {pin}: the stage {stage} drives whenever this input floats, as it does while "
        "{chip} is in reset; fit some 10 kOhm to ground and add {pin} to pulldowns",
    )
    PULL_DOWN_WITHOUT_USE = (
        20,
        "pulldowns: GPIO {pin} is not an output of this board; leave it out, or correct the number",
    )
    FREQUENCY_HIGH = 21, "pwm_frequency_hz = {value}: the stage {stage} takes {limit} at most"
    FREQUENCY_LOW = 22, "pwm_frequency_hz = {value}: choose {limit} at least"
    COUNTERS = 23, "{chip} has {limit} pulse counters, two wheels need {value}"
    PWM_OUTPUTS = 24, "{chip} has {limit} PWM outputs, the stage {stage} needs {value}"
    FILTER = 25, "encoder_filter_ns = {value}: the chip's filter ends at {limit}"
    DIVIDER = (
        26,
        "battery.divider = {value} thousandths: choose 1 to 20, battery volts per volt at the pin",
    )
    LINE = 27, "link: {chip} has no USB of its own, and a Raspberry Pi none at all; write uart"
    CODE = 28, "a code is unknown to this firmware: update it"
    PIN_HELD_HIGH = (
        29,
        "{function} = {pin}: GPIO {pin} of {chip} is high while it starts, which may drive a "
        "motor, and 10 kOhm to ground does not change that; choose another",
    )
    PIN_PULLED_UP = (
        30,
        "{function} = {pin}: {chip} pulls GPIO {pin} up while it starts, which may drive a motor; "
        "choose another, or fit some 10 kOhm to ground and add {pin} to pulldowns",
    )
    MODULE = 31, "module: {chip} has no such module; leave it out, or name another"
    LED_ON_STRAP = (
        32,
        "{function} = {pin}: the level of GPIO {pin} at reset selects how {chip} starts, and the "
        "LED pulls on it; if the chip does not start, or takes no firmware, choose another",
    )


WARNINGS = frozenset({BoardFault.LED_ON_STRAP})
"""What is worth a sentence, but refuses no board."""
PIN_FUNCTIONS: tuple[str, ...] = tuple(f.name.lower() for f in BoardPin)
"""The fields of the packed struct with a pin, in the order of `BoardPin`."""
# Their names and values are part of the group's hash: a host does not write a board to a device
# that gives a code another meaning.
CODES: tuple[type[DocumentedEnum], ...] = (
    Stage,
    EncoderPulls,
    ContactKind,
    BoardLine,
    ConfigurationState,
    Module,
    BoardPin,
    BoardFault,
)
"""The codes of the group BOARD."""
NO_PIN = -1


@dataclass(frozen=True)
class ChipTable:
    """What a chip, on its usual modules, does with its pins. Sets are of GPIO numbers.

    Attributes:
        name: As in a board's file.
        title: As in sentences.
        existing: Pins that lead out of the chip.
        strapping: Their level at reset selects how the chip starts.
        memory: Pins of flash and PSRAM, on any module.
        input_only: Without an output driver and without pull resistors.
        adc: Pins that can measure a voltage while everything else runs.
        uart: Pins of the line through the board's USB bridge.
        usb: Pins of the chip's own USB; empty if it has none.
        pulled_up: Pins with a weak pull-up at reset, or from then on until our program sets them.
            Some 45 kOhm against the 10 kOhm of a board's pull-down leave 0.6 V, which is low.
        held_high: Pins that an output, or a resistor stronger than 10 kOhm, holds high then. Pins
            in neither set float or are pulled down.
        levels_source: Source of these two sets.
        counters: Pulse counters.
        pwm_outputs: Outputs of its motor-control PWM.
        has_led: Whether the firmware can show its state on an LED.
    """

    name: str
    title: str
    existing: frozenset[int]
    pulled_up: frozenset[int]
    held_high: frozenset[int]
    levels_source: str
    counters: int
    pwm_outputs: int
    strapping: frozenset[int] = frozenset()
    memory: frozenset[int] = frozenset()
    input_only: frozenset[int] = frozenset()
    adc: frozenset[int] = frozenset()
    uart: frozenset[int] = frozenset()
    usb: frozenset[int] = frozenset()
    has_led: bool = True


def _span(first: int, last: int) -> frozenset[int]:
    return frozenset(range(first, last + 1))


CHIPS: Mapping[Chip, ChipTable] = MappingProxyType(
    {
        Chip.ESP32: ChipTable(
            name="esp32",
            title="the ESP32",
            # 37 and 38 are on the chip, but its usual modules do not lead them out.
            existing=_span(0, 39) - {20, 24, 28, 29, 30, 31, 37, 38},
            strapping=frozenset({0, 2, 5, 12, 15}),
            memory=_span(6, 11) | {16, 17},
            input_only=_span(34, 39),
            adc=_span(32, 39),
            uart=frozenset({1, 3}),
            # 14 is MTMS; 6 to 11 are the flash's.
            pulled_up=frozenset({0, 3, 5, 14, 15}) | _span(6, 11),
            held_high=frozenset({1}),  # The ROM sends text on it.
            levels_source="ESP32 data sheet, table IO_MUX",
            counters=8,
            # Six for each MCPWM unit: the ESP32 and the S3 have two units, the C6 has one.
            pwm_outputs=12,
        ),
        Chip.ESP32S3: ChipTable(
            name="esp32s3",
            title="the ESP32-S3",
            existing=_span(0, 48) - _span(22, 25),
            strapping=frozenset({0, 3, 45, 46}),
            memory=_span(26, 37),
            adc=_span(1, 10),
            uart=frozenset({43, 44}),
            usb=frozenset({19, 20}),
            # 39 is MTCK, 20 the D+ of USB.
            pulled_up=frozenset({0, 20, 39, 44}) | _span(26, 32),
            held_high=frozenset({43}),  # The ROM sends text on it.
            levels_source="ESP32-S3 data sheet, pin overview",
            counters=4,
            pwm_outputs=12,
        ),
        Chip.ESP32C6: ChipTable(
            name="esp32c6",
            title="the ESP32-C6",
            existing=_span(0, 30) - {14},
            strapping=frozenset({4, 5, 8, 9, 15}),
            memory=_span(24, 30),
            adc=_span(0, 6),
            uart=frozenset({16, 17}),
            usb=frozenset({12, 13}),
            # 6 is MTCK, 13 the D+ of USB, 18 to 23 are SDIO's.
            pulled_up=frozenset({6, 9, 13, 17}) | _span(18, 30),
            held_high=frozenset({16}),  # The ROM sends text on it.
            levels_source="ESP32-C6 data sheet, pin overview",
            counters=4,
            pwm_outputs=6,
        ),
        # Its pins are moved and counted by the computer itself, as many as there are.
        Chip.LINUX: ChipTable(
            name="raspberry-pi",
            title="the Raspberry Pi",
            existing=_span(0, 27),
            pulled_up=_span(4, 8),
            # 2 and 3 have 1.8 kOhm to 3.3 V on the computer's board. 0 and 1 have 3.9 kOhm on a
            # HAT, and the computer looks for one on them; 14 is the output of its serial console.
            held_high=_span(0, 3) | {14},
            levels_source=(
                "BCM2835 ARM Peripherals, table 6-31, and BCM2711 ARM Peripherals, GPIO; schematics"
            ),
            counters=28,
            pwm_outputs=28,
            has_led=False,
        ),
    }
)


@dataclass(frozen=True)
class ModuleTable:
    """A module, where it has other pins to spare than the others of its chip.

    Attributes:
        name: As in a board's file.
        chip: On it.
        memory: GPIOs of its flash and PSRAM.
        source: Where these are from.
    """

    name: str
    chip: Chip
    memory: frozenset[int]
    source: str


MODULES: Mapping[Module, ModuleTable] = MappingProxyType(
    {
        Module.WROOM_32: ModuleTable(
            "wroom-32", Chip.ESP32, _span(6, 11), "ESP32-WROOM-32 data sheet, pin definitions"
        ),
        Module.WROVER: ModuleTable(
            "wrover",
            Chip.ESP32,
            _span(6, 11) | {16, 17},
            "ESP32-WROVER data sheet, pin definitions",
        ),
        Module.S3_QUAD: ModuleTable(
            "s3-quad", Chip.ESP32S3, _span(26, 32), "ESP32-S3 data sheet, mapping of flash pins"
        ),
        Module.S3_OCTAL: ModuleTable(
            "s3-octal", Chip.ESP32S3, _span(26, 37), "ESP32-S3 data sheet, mapping of flash pins"
        ),
    }
)

MIN_FREQUENCY_HZ = 100
MAX_FILTER_NS = 12_787
"""1023 cycles of 80 MHz."""
