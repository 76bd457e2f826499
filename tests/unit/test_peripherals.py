"""Peripherals as data: a board's file, the packed list, and the rules, each with its sentence."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
import yaml
from construct import Struct
from hypothesis import given
from hypothesis import strategies as st

from support.cases import each
from wheelwire.board import (
    AnalogInput,
    BatteryLevels,
    Configuration,
    DigitalInput,
    ImuSensor,
    Peripheral,
    PowerSensor,
    Pull,
    RangeSensor,
    packed_entry,
    unpacked,
    unpacked_entry,
)
from wheelwire.errors import ConfigurationError
from wheelwire.tools.files.board import load_board, parse_board, to_yaml
from wheelwire.tools.files.peripherals import without_none
from wheelwire.tools.files.robot import parse_config
from wheelwire_protocol import board_layout
from wheelwire_protocol.board_layout import BOARD_SIZE, PERIPHERAL_SIZE
from wheelwire_protocol.codes import (
    DIGITAL_INPUTS,
    MOST_PERIPHERALS,
    PeripheralKind,
    Place,
    channel_name,
)
from wheelwire_protocol.core import check_peripherals
from wheelwire_protocol.message import fields_of
from wheelwire_protocol.peripherals import (
    IMUS,
    MOST_RANGES,
    POWERS,
    RANGES,
    Axis,
    PeripheralFault,
    SensorChip,
)

BOARD = """\
name: mine
chip: esp32
module: wroom-32
stage: enable_in1_in2
left: {enable: 25, in1: 26, in2: 27, encoder_a: 18, encoder_b: 19}
right: {enable: 33, in1: 32, in2: 4, encoder_a: 23, encoder_b: 13}
estop: {pin: 14, contact: normally_closed}
pulldowns: [25, 33]
"""
IMU = "imu: {chip: mpu6050, sda: 16, scl: 17, interrupt: 35, forward: y, up: z}\n"
POWER = "power: {chip: ina219, sda: 16, scl: 17, shunt_mohm: 100, address: 0x40, cells: 3}\n"
INPUTS = """\
inputs:
  bumper_front_left: {pin: 34, pull: external}
  cliff_front: {pin: 39, triggered: low, pull: external}
  stage_fault: {pin: 36, pull: external}
"""
ALL = BOARD + IMU + POWER + INPUTS

PINS = st.none() | st.integers(0, 127)
BUSES = st.one_of(
    st.tuples(PINS, st.integers(0, 127), st.none()),
    st.tuples(st.none(), st.none(), st.none() | st.integers(0, 127)),
)
"""Data, clock, number."""
ADDRESSES = st.none() | st.integers(1, 0x77)
COUNTS = st.integers(-32_768, 32_767)
LEVELS_V = st.integers(1, 65_000).map(lambda millivolts: millivolts / 1000)


@st.composite
def imus(draw: st.DrawFn) -> ImuSensor:
    chip = draw(st.sampled_from(list(IMUS)))
    x, y, z = (draw(COUNTS) * IMUS[chip].gyro_radps for _ in "xyz")
    sda, scl, bus = draw(BUSES)
    return ImuSensor(
        chip,
        sda=sda,
        scl=scl,
        interrupt=draw(PINS),
        forward=draw(st.sampled_from(Axis)),
        up=draw(st.sampled_from(Axis)),
        address=draw(ADDRESSES),
        bias=(round(x, 5), round(y, 5), round(z, 5)),
        bus=bus,
    )


PERIPHERALS: st.SearchStrategy[Peripheral] = st.one_of(
    imus(),
    st.builds(
        lambda on, chip, shunt_mohm, address: PowerSensor(
            chip, on[0], on[1], shunt_mohm, address, bus=on[2]
        ),
        BUSES,
        st.sampled_from(list(POWERS)),
        st.integers(1, 65_535).map(lambda steps: steps / 10),
        ADDRESSES,
    ),
    st.builds(BatteryLevels, LEVELS_V, LEVELS_V, LEVELS_V),
    st.builds(
        DigitalInput,
        st.sampled_from(DIGITAL_INPUTS),
        st.sampled_from(Place),
        PINS,
        st.booleans(),
        st.sampled_from(Pull),
    ),
    st.builds(RangeSensor, st.sampled_from(list(RANGES)), st.sampled_from(Place), PINS, PINS),
    st.builds(
        AnalogInput,
        st.integers(0, 65_535),
        PINS,
        st.integers(0, 65_535).map(lambda thousandths: thousandths / 1000),
    ),
)
LISTS = st.lists(PERIPHERALS, max_size=MOST_PERIPHERALS).map(tuple)


def board_of(text: str) -> Any:
    return parse_board(yaml.safe_load(text))


def test_the_example_can_be_used() -> None:
    board = board_of(ALL)
    assert board.problems() == []
    assert [channel_name(one.kind, one.place) for one in board.peripherals] == [
        "imu",
        "power",
        "battery",
        "bumper.front_left",
        "cliff.front",
        "stage_fault",
    ]
    assert board.peripherals[0] == ImuSensor(SensorChip.MPU6050, 16, 17, 35, Axis.Y, Axis.Z)
    assert board.peripherals[2] == BatteryLevels(10.5, 10.2, 9.9)
    assert board.peripherals[3].pull is Pull.EXTERNAL
    assert not board.peripherals[3].triggered_low
    assert board.peripherals[5].triggered_low
    assert board_of(to_yaml(board)) == board
    assert "forward: y, up: z" in to_yaml(board)
    assert "bias" not in to_yaml(board)


def test_one_fingerprint_names_the_board_and_its_peripherals() -> None:
    plain, board = board_of(BOARD), board_of(ALL)
    assert plain.peripherals == ()
    assert unpacked(board.packed()) == board
    assert unpacked(plain.packed()) == plain
    fewer = replace(board, peripherals=board.peripherals[1:])
    others = [plain, fewer, replace(board, led=2), board]
    assert len({one.fingerprint() for one in others}) == len(others)


def yaml_of(page: str) -> list[str]:
    text = (Path(__file__).parents[2] / "docs" / page).read_text("utf-8")
    return re.findall(r"^```yaml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def test_what_the_page_of_a_pi_s_sensors_shows_can_be_used() -> None:
    (piece,) = yaml_of("pi-sensors.md")
    board = parse_config(yaml.safe_load(piece)).pins
    assert len(board.peripherals) == 5
    assert board.problems() == []


def test_what_the_page_shows_can_be_used() -> None:
    # Others are robots' files.
    pieces = [piece for piece in yaml_of("sensors.md") if piece.startswith("module:")]
    assert len(pieces) == 2
    for piece in pieces:
        board = board_of(BOARD.replace("module: wroom-32\n", "") + piece)
        assert board.problems() == []
        assert board_of(to_yaml(board)) == board


DIVIDER = "battery: {pin: 35, divider: 4}\n"
KEPT: list[tuple[str, tuple[Peripheral, ...]]] = [
    (IMU, (ImuSensor(SensorChip.MPU6050, 16, 17, 35, Axis.Y, Axis.Z),)),
    ("inputs: {analog_1: {pin: 34}}", (AnalogInput(1, 34, 1.0),)),
    ("inputs: {analog_2: {pin: 34, divider: 2.0}}", (AnalogInput(2, 34, 2.0),)),
    (
        "ranges: {left: {chip: hc-sr04, trigger: 16, echo: 35}}",
        (RangeSensor(SensorChip.HC_SR04, Place.LEFT, 16, 35),),
    ),
    # A battery that is measured only.
    (DIVIDER + "power: {}", (BatteryLevels(),)),
    (
        DIVIDER + POWER.replace("cells: 3", "warn_v: 0, limit_v: 0, stop_v: 0"),
        (PowerSensor(SensorChip.INA219, 16, 17, 100.0, 0x40), BatteryLevels()),
    ),
    *((f"{section}:", ()) for section in ("imu", "power", "inputs", "ranges")),
]


@each(("sections", "entries"), KEPT)
def test_a_file_survives_the_way_to_data_and_back(
    sections: str, entries: tuple[Peripheral, ...]
) -> None:
    board = board_of(BOARD + sections)
    assert board.peripherals == entries
    assert board.problems() == []
    assert board_of(to_yaml(board)) == board


def test_a_bias_is_kept_in_counts_of_its_chip() -> None:
    text = IMU.replace("up: z", "up: z, bias: [0.01, -0.02, 0]")
    board = board_of(BOARD + text)
    (imu,) = board.peripherals
    assert imu.bias == (0.01, -0.02, 0.0)
    assert board_of(to_yaml(board)) == board
    stored = unpacked_entry(packed_entry(imu))
    assert isinstance(stored, ImuSensor)
    half_a_count = IMUS[imu.chip].gyro_radps / 2
    assert stored.bias == pytest.approx(imu.bias, abs=half_a_count)
    # What a device reports is written back to it unchanged.
    assert packed_entry(stored) == packed_entry(imu)
    assert b"\x26\x00\xb5\xff\x00\x00" in packed_entry(imu)  # 38, -75 and 0 counts


def test_levels_stand_behind_the_chip_whatever_their_channel() -> None:
    power, levels = board_of(BOARD + POWER).peripherals
    board = replace(board_of(BOARD), peripherals=(levels, power))
    assert board_of(to_yaml(board)).peripherals == (power, levels)


@given(PERIPHERALS)
def test_an_entry_survives_the_way_to_bytes_and_back(entry: Peripheral) -> None:
    data = packed_entry(entry)
    assert len(data) == PERIPHERAL_SIZE
    assert unpacked_entry(data) == entry
    layout = Struct(*fields_of(board_layout.Peripheral))
    assert layout.build(layout.parse(data)) == data


def with_all(entries: tuple[Peripheral, ...]) -> Configuration:
    return replace(load_board("l298n"), peripherals=entries)


@given(LISTS)
def test_a_list_survives_the_way_to_bytes_and_back(entries: tuple[Peripheral, ...]) -> None:
    board = with_all(entries)
    assert unpacked(board.packed()) == board
    assert len(board.packed()) == 228
    # The core checks any list.
    assert all(problem and "{" not in problem for problem in board.problems())


@pytest.mark.parametrize(("at", "value"), [(0, 2), (BOARD_SIZE, MOST_PERIPHERALS + 1)])
def test_a_configuration_of_another_format_is_not_read(at: int, value: int) -> None:
    body = bytearray(load_board("l298n").packed()[:-4])
    body[at] = value
    with pytest.raises(ConfigurationError, match="update the older one"):
        unpacked(bytes(body) + crc32(body).to_bytes(4, "little"))


@pytest.mark.parametrize("at", [0, 1, 2, 8, 9])
def test_an_entry_with_an_unknown_code_is_not_read(at: int) -> None:
    data = bytearray(packed_entry(board_of(ALL).peripherals[0]))
    data[at] = 99
    with pytest.raises(ConfigurationError, match="update wheelwire"):
        unpacked_entry(bytes(data))


def test_a_list_that_is_too_long_is_not_packed() -> None:
    too_many = with_all((BatteryLevels(3, 2, 1),) * 11)
    assert too_many.problems() == ["11 entries: a board takes 10 at most"]
    with pytest.raises(ConfigurationError, match="11 entries: a board takes 10"):
        too_many.packed()


MPU = SensorChip.MPU6050
NAN, INF = float("nan"), float("inf")


@each(
    ("entry", "words"),
    [
        (ImuSensor(MPU, 200, 17), "imu cannot be packed"),
        (ImuSensor(MPU, 2, None), "imu.scl is missing: name it, or the bus"),
        (ImuSensor(MPU, 16, 17, bias=(0, 9, 0)), r"imu.bias = \(0, 9, 0\): choose -8.73 to 8.73"),
        (ImuSensor(MPU, 16, 17, bias=(0, NAN, 0)), "imu.bias"),
        (ImuSensor(MPU, 16, 17, bias=(0, INF, 0)), "imu.bias"),
        (ImuSensor(MPU, 16, 17, bias=(1, 1)), "imu.bias"),  # type: ignore[arg-type]
        (ImuSensor(SensorChip.INA219, 16, 17, bias=(1, 1, 1)), "imu.chip = INA219"),
        (PowerSensor(SensorChip.INA219, 16, 17, NAN), "power cannot be packed"),
        (BatteryLevels(INF, 2, 1), "power cannot be packed"),
        (AnalogInput(1, 32, 66.0), "inputs.analog_1 cannot be packed"),
        (AnalogInput(1, 32, NAN), "inputs.analog_1 cannot be packed"),
        (RangeSensor(SensorChip.HC_SR04, Place.FRONT, 200, 35), "ranges.front cannot be packed"),
    ],
)
def test_values_that_do_not_fit_are_not_packed(entry: Peripheral, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        packed_entry(entry)


def section(name: str, content: dict[str, Any]) -> str:
    """A section of a board's file, in one line; without what is None."""
    return f"{name}: {json.dumps(without_none(content))}\n"


def imu(**changes: Any) -> str:
    sound = {"chip": "mpu6050", "sda": 16, "scl": 17, "forward": "x", "up": "z"}
    return section("imu", sound | changes)


def power(**changes: Any) -> str:
    return section("power", {"chip": "ina219", "sda": 16, "scl": 17, "shunt_mohm": 100} | changes)


def input_(name: str, **content: Any) -> str:
    return section("inputs", {name: content})


def bumper(**content: Any) -> str:
    return input_("bumper_rear", **content)


def front(**changes: Any) -> str:
    """A range sensor."""
    sound = {"chip": "hc-sr04", "trigger": 16, "echo": 35}
    return section("ranges", {"front": without_none(sound | changes)})


ON_A_BUS = {"sda": None, "scl": None}
FOUR_RANGES = """\
ranges:
  front: {chip: hc-sr04, trigger: 16, echo: 34}
  left: {chip: hc-sr04, trigger: 17, echo: 35}
  right: {chip: hc-sr04, trigger: 21, echo: 36}
  rear: {chip: hc-sr04, trigger: 22, echo: 39}
"""
REAR, ANALOG_1 = "inputs.bumper_rear", "inputs.analog_1"
Fault = PeripheralFault
WRONG: list[tuple[str, PeripheralFault, str, int]] = [
    (imu(sda=25), Fault.PIN_TAKEN, "imu", 25),
    (imu(**ON_A_BUS), Fault.PIN_MISSING, "imu", 0),
    (imu(**ON_A_BUS, bus=1), Fault.BUS, "imu", 0),
    (imu(sda=24), Fault.PIN_ABSENT, "imu", 24),
    (imu(sda=34), Fault.PIN_INPUT_ONLY, "imu", 34),
    (imu(sda=6), Fault.PIN_OF_MEMORY, "imu", 6),
    (imu(sda=1), Fault.PIN_OF_LINK, "imu", 1),
    (imu(sda=2), Fault.PIN_STRAPPING, "imu", 2),
    (imu(up="-x"), Fault.ORIENTATION, "imu", 0),
    (imu() + power(address=0x68), Fault.TWICE, "power", 0),
    (power(cells=3, warn_v=10), Fault.LEVELS, "power", 0),
    (section("power", {"cells": 3}), Fault.NO_BATTERY, "power", 0),
    (bumper(pin=34, pull="external", triggered="low"), Fault.NORMALLY_OPEN, REAR, 0),
    (input_("cliff_front", pin=34), Fault.NO_PULL, "inputs.cliff_front", 34),
    (bumper(pin=34, pull="down"), Fault.NO_PULL, REAR, 34),
    (bumper(pin=16, pull="down"), Fault.NO_PULL, REAR, 16),
    (input_("analog_1", pin=16), Fault.NO_ADC, ANALOG_1, 16),
    (front(echo=16), Fault.PIN_TAKEN, "ranges.front", 16),
    (FOUR_RANGES, Fault.TOO_MANY_RANGES, "ranges.rear", 0),
]
"""Part of a board's file, the rule that it breaks, and what the sentence names; 0: no pin."""


@each(("sections", "fault", "entry", "pin"), WRONG)
def test_a_wrong_list_is_refused_by_its_own_sentence(
    sections: str, fault: PeripheralFault, entry: str, pin: int
) -> None:
    sentence = fault.doc.format(entry=entry, pin=pin, limit=MOST_RANGES)
    assert board_of(BOARD + sections).problems() == [sentence]


def test_a_key_that_is_suggested_can_be_used() -> None:
    with pytest.raises(ConfigurationError) as caught:
        board_of(BOARD + "inputs: {bumpers: {pin: 34, pull: external}}")
    suggested = re.findall(r"bumper\w*", str(caught.value).partition(";")[2])
    assert suggested
    for name in suggested:
        board = board_of(BOARD + f"inputs: {{{name}: {{pin: 34, pull: external}}}}")
        assert board.problems() == []


@each(
    ("entry", "words"),
    [
        (DigitalInput(PeripheralKind.BUMPER, Place.LEFT, 34), "place: a bumper is at the front or"),
        (AnalogInput(1, 34, 0.5), "divider = 500 thousandths: choose 1000 to 20000"),
        (PowerSensor(SensorChip.INA219, 16, 17, 0.04), "shunt_mohm rounds to 0: choose 0.1 to"),
        (
            PowerSensor(SensorChip.INA219, 16, 17, 1.0, address=0x78),
            "power: the firmware does not know one of its codes",
        ),
    ],
)
def test_what_no_file_can_have_is_refused_by_the_rules(entry: Peripheral, words: str) -> None:
    problems = replace(board_of(BOARD), peripherals=(entry,)).problems()
    assert any(words in problem for problem in problems)


PI_SECTIONS = """
imu: {chip: mpu6050, bus: 1, forward: y, up: z}
power: {chip: ina219, bus: 1, shunt_mohm: 100, cells: 3}
inputs:
  bumper_front_left: {pin: 8}
  cliff_front: {pin: 7, pull: down}
"""


PI_IMU = ImuSensor(SensorChip.MPU6050, None, None, None, Axis.Y, Axis.Z, bus=1)


def pi_with(sections: str) -> Any:
    return replace(load_board("pi4b"), peripherals=board_of(BOARD + sections).peripherals)


def test_a_pi_has_its_buses_by_number() -> None:
    board = pi_with(PI_SECTIONS)
    assert board.problems() == []
    assert board.peripherals[0] == PI_IMU
    assert board_of(to_yaml(board)) == board
    assert unpacked(board.packed()) == board


@each(
    ("sections", "fault", "entry", "pin"),
    [
        (imu(**ON_A_BUS, bus=1) + bumper(pin=2), Fault.PIN_TAKEN, REAR, 2),
        (bumper(pin=18), Fault.PIN_TAKEN, REAR, 18),
        (bumper(pin=28), Fault.PIN_ABSENT, REAR, 28),
    ],
)
def test_what_a_pi_cannot_have(sections: str, fault: PeripheralFault, entry: str, pin: int) -> None:
    assert pi_with(sections).problems() == [fault.doc.format(entry=entry, pin=pin)]


def test_a_bus_that_comes_after_an_input_on_its_pin() -> None:
    """A file names the bus first; a program may list them in any order."""
    bumper = DigitalInput(PeripheralKind.BUMPER, Place.REAR, 2)
    (problem,) = replace(load_board("pi4b"), peripherals=(bumper, PI_IMU)).problems()
    assert problem.startswith("imu: 2: GPIO 2 is in use already")


def test_a_computer_has_neither_a_timer_nor_an_adc_for_sensors() -> None:
    board = pi_with("inputs: {cliff: {pin: 7}}")
    data = bytearray(board.packed())
    data[BOARD_SIZE + 1] = PeripheralKind.ANALOG
    data[-4:] = crc32(data[:-4]).to_bytes(4, "little")
    (issue,) = check_peripherals(bytes(data))
    assert issue.fault is PeripheralFault.NOT_ON_THIS_CHIP
    assert issue.fault.doc.format(entry="power") == (
        "power: the chip of this board cannot read it, an ESP32 can"
    )


def test_every_rule_that_a_file_can_break_is_broken_by_one() -> None:
    beyond_files = {
        PeripheralFault.NONE,
        PeripheralFault.KIND,
        # Refused by its name, before it is anybody's entry.
        PeripheralFault.CHIP,
        # Checked without a board's chip, and before packing: see above.
        PeripheralFault.NOT_ON_THIS_CHIP,
        PeripheralFault.TOO_MANY,
        # Refused by its key: see below.
        PeripheralFault.PLACE,
        PeripheralFault.SHUNT,
        PeripheralFault.CODE,
        PeripheralFault.DIVIDER,
    }
    assert set(PeripheralFault) - {fault for _, fault, _, _ in WRONG} == beyond_files


def test_each_kind_of_input_is_named_as_its_section() -> None:
    assert channel_name(PeripheralKind.CLIFF, Place.NONE) == "cliff"
    assert channel_name(PeripheralKind.BUMPER, Place.REAR_RIGHT) == "bumper.rear_right"
    assert channel_name(PeripheralKind.RANGE, Place.LEFT) == "range.left"
    assert channel_name(PeripheralKind.ANALOG, Place.NONE, 4) == "analog_4"
