"""Peripherals as data: a board's file, the packed list, and the rules, each with its sentence."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from construct import Struct
from hypothesis import given
from hypothesis import strategies as st

from wheelwire.board import unpacked
from wheelwire.errors import ConfigurationError
from wheelwire.files.board import load_board, parse_board, to_yaml
from wheelwire.peripherals import (
    DIGITAL_INPUTS,
    BatteryLevels,
    DigitalInput,
    ImuSensor,
    Peripheral,
    PowerSensor,
    Pull,
    channel_name,
    fingerprint,
    packed_entry,
    packed_list,
    peripheral_problems,
    unpacked_entry,
    unpacked_list,
)
from wheelwire_protocol.messages import PERIPHERAL_SIZE, peripheral_fields
from wheelwire_protocol.sensors import (
    IMUS,
    MOST_PERIPHERALS,
    POWERS,
    Axis,
    PeripheralFault,
    PeripheralKind,
    Place,
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
ADDRESSES = st.none() | st.integers(1, 0x77)
LEVELS_V = st.integers(1, 65_000).map(lambda millivolts: millivolts / 1000)
PERIPHERALS: st.SearchStrategy[Peripheral] = st.one_of(
    st.builds(
        ImuSensor,
        st.sampled_from(list(IMUS)),
        PINS,
        PINS,
        PINS,
        st.sampled_from(Axis),
        st.sampled_from(Axis),
        ADDRESSES,
    ),
    st.builds(
        PowerSensor,
        st.sampled_from(list(POWERS)),
        PINS,
        PINS,
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


def test_peripherals_are_no_part_of_the_packed_board() -> None:
    plain, board = board_of(BOARD), board_of(ALL)
    assert plain.peripherals == ()
    assert board.packed() == plain.packed()
    assert unpacked(board.packed()) == plain


def test_a_file_survives_the_way_to_data_and_back() -> None:
    board = board_of(ALL)
    assert board_of(to_yaml(board)) == board
    assert "forward: y, up: z" in to_yaml(board)


def test_levels_stand_behind_the_chip_whatever_their_channel() -> None:
    power, levels = board_of(BOARD + POWER).peripherals
    board = replace(board_of(BOARD), peripherals=(levels, power))
    assert board_of(to_yaml(board)).peripherals == (power, levels)


@pytest.mark.parametrize(
    "sections", ["power: {}\n", POWER.replace("cells: 3", "warn_v: 0, limit_v: 0, stop_v: 0")]
)
def test_a_battery_may_be_measured_only(sections: str) -> None:
    divider = BOARD + "battery: {pin: 35, divider: 4}\n"
    board = board_of(divider + sections)
    assert board.peripherals[-1] == BatteryLevels()
    assert board.problems() == []
    assert board_of(to_yaml(board)) == board


@given(PERIPHERALS)
def test_an_entry_survives_the_way_to_bytes_and_back(entry: Peripheral) -> None:
    data = packed_entry(entry)
    assert len(data) == PERIPHERAL_SIZE
    assert unpacked_entry(data) == entry
    layout = Struct(*peripheral_fields())
    assert layout.build(layout.parse(data)) == data


@given(LISTS, st.integers(0, 0xFFFF_FFFF))
def test_a_list_survives_the_way_to_bytes_and_back(
    entries: tuple[Peripheral, ...], board: int
) -> None:
    data = packed_list(entries, board)
    assert unpacked_list(data) == (entries, board)
    assert fingerprint(entries, board) != fingerprint(entries, board ^ 1)


@given(LISTS)
def test_the_core_checks_any_list(entries: tuple[Peripheral, ...]) -> None:
    problems = peripheral_problems(entries, load_board("l298n").packed())
    assert all(problem and "{" not in problem for problem in problems)


def test_a_damaged_list_is_not_read() -> None:
    data = packed_list(board_of(ALL).peripherals, 1)
    for wrong in (b"", data[:-1], bytes([data[0] ^ 2]) + data[1:]):
        with pytest.raises(ConfigurationError, match="checksum is wrong: write it again"):
            unpacked_list(wrong)


@pytest.mark.parametrize(("at", "value"), [(0, 2), (1, MOST_PERIPHERALS + 1)])
def test_a_list_of_another_format_is_not_read(at: int, value: int) -> None:
    from zlib import crc32

    body = bytearray(packed_list((), 1)[:-4])
    body[at] = value
    with pytest.raises(ConfigurationError, match="update the older one"):
        unpacked_list(bytes(body) + crc32(body).to_bytes(4, "little"))


@pytest.mark.parametrize("at", [0, 1, 2, 8, 9])
def test_an_entry_with_an_unknown_code_is_not_read(at: int) -> None:
    data = bytearray(packed_entry(board_of(ALL).peripherals[0]))
    data[at] = 99
    with pytest.raises(ConfigurationError, match="update wheelwire"):
        unpacked_entry(bytes(data))


def test_what_does_not_fit_is_not_packed() -> None:
    with pytest.raises(ConfigurationError, match="imu cannot be packed"):
        packed_entry(ImuSensor(SensorChip.MPU6050, 200, 17))
    with pytest.raises(ConfigurationError, match="11 entries: a board takes 10"):
        packed_list([BatteryLevels(3, 2, 1)] * 11, 0)


# Each with the part of the file that is wrong, and the sentence.
WRONG: list[tuple[str, str]] = [
    ("imu: {chip: mpu6050, sda: 25, scl: 17, forward: x, up: z}", "imu: 25: GPIO 25 is in use"),
    ("imu: {chip: mpu6050, sda: 16, scl: 16, forward: x, up: z}", "imu: 16: GPIO 16 is in use"),
    ("imu: {chip: mpu6050, scl: 17, forward: x, up: z}", "imu: a pin is missing"),
    ("imu: {chip: mpu6050, sda: 24, scl: 17, forward: x, up: z}", "imu: 24: the chip has no GPIO"),
    ("imu: {chip: mpu6050, sda: 34, scl: 17, forward: x, up: z}", "imu: 34: GPIO 34 is an input"),
    ("imu: {chip: mpu6050, sda: 6, scl: 17, forward: x, up: z}", "imu: 6: GPIO 6 leads to flash"),
    ("imu: {chip: mpu6050, sda: 1, scl: 17, forward: x, up: z}", "imu: 1: GPIO 1 carries the line"),
    ("imu: {chip: mpu6050, sda: 2, scl: 17, forward: x, up: z}", "imu: 2: the level of GPIO 2"),
    ("imu: {chip: mpu6050, sda: 16, scl: 17, forward: x, up: -x}", "choose two different axes"),
    (
        "imu: {chip: mpu6050, sda: 16, scl: 17, forward: x, up: z, address: 0x78}",
        "imu: a code is unknown",
    ),
    (
        IMU + "power: {chip: ina226, sda: 16, scl: 17, shunt_mohm: 2, address: 0x68}",
        "power: there is already one of this kind at this place",
    ),
    (POWER.replace("cells: 3", "cells: 3, warn_v: 10"), "power: the levels must fall"),
    ("power: {cells: 3}", "power: the board has no battery divider, and the list no power sensor"),
    ("power: {chip: ina219, sda: 16, scl: 17, shunt_mohm: 0.04}", "power: shunt_mohm = 0: choose"),
    ("inputs: {bumper: {pin: 34, pull: external}}", "inputs.bumper: place: a bumper is at the"),
    (
        "inputs: {bumper_rear: {pin: 34, pull: external, triggered: low}}",
        "inputs.bumper_rear: a bumper must be normally closed",
    ),
    ("inputs: {cliff_front: {pin: 34}}", "inputs.cliff_front: 34: GPIO 34 has no pull-up"),
]


@pytest.mark.parametrize(("sections", "words"), WRONG)
def test_a_wrong_list_is_refused_by_its_own_sentence(sections: str, words: str) -> None:
    (problem,) = board_of(BOARD + sections).problems()
    assert words in problem


def test_a_pi_has_no_peripherals() -> None:
    board = replace(load_board("pi4b"), peripherals=board_of(ALL).peripherals)
    assert board.problems() == [PeripheralFault.NOT_ON_THIS_CHIP.doc]


def test_every_rule_that_a_file_can_break_is_broken_by_one() -> None:
    beyond_files = {
        PeripheralFault.NONE,
        PeripheralFault.FORMAT,
        PeripheralFault.DAMAGED,
        PeripheralFault.OTHER_BOARD,
        PeripheralFault.KIND,
        # Refused by its name, before it is anybody's entry.
        PeripheralFault.CHIP,
        # Checked without a board's chip, and before packing: see above.
        PeripheralFault.NOT_ON_THIS_CHIP,
        PeripheralFault.TOO_MANY,
    }
    broken = set()
    for sections, _ in WRONG:
        for fault in PeripheralFault:
            pattern = re.sub(r"\\\{\w+\\\}", ".*", re.escape(fault.doc))
            texts = board_of(BOARD + sections).problems()
            broken |= {fault} if any(re.fullmatch(pattern, text) for text in texts) else set()
    assert set(PeripheralFault) - broken == beyond_files


NOT_PERIPHERALS: list[tuple[str, str]] = [
    ("imu: {chip: mpu6050, sd: 16}", "imu.sd = 16: unknown key; did you mean imu.sda?"),
    ("imu: [1]", "imu = [1]: it must be names with values"),
    ("imu: {sda: 16, scl: 17, forward: x, up: z}", "imu.chip is missing: add it"),
    ("imu: {chip: mpu6050, sda: 16, scl: 17, up: z}", "imu.forward is missing: add it"),
    ("imu: {chip: ina219}", "imu.chip = 'ina219': choose one of mpu6050, mpu6500, mpu9250"),
    ("imu: {chip: mpu6050, sda: a}", "imu.sda = 'a': it must be the number of a GPIO"),
    ("imu: {chip: mpu6050, forward: w, up: z}", "imu.forward = 'w': choose one of x, y, z, -x"),
    (
        "imu: {chip: mpu6050, forward: x, up: z, address: 200}",
        "imu.address = 200: it must be a whole number, 0 to 127",
    ),
    (
        "imu: {chip: mpu6050, forward: x, up: z, address: 0}",
        "imu.address = 0: leave it out for the chip's usual one",
    ),
    ("power: {sda: 16}", "power.chip is missing: add it"),
    ("power: {chip: ina219, sda: 16, scl: 17}", "power.shunt_mohm is missing: add it"),
    (
        "power: {chip: ina219, shunt_mohm: 7000}",
        "power.shunt_mohm = 7000: it must be 6553.5 at most",
    ),
    ("power: {cells: 0}", "power.cells = 0: it must be a whole number, 1 to 15"),
    ("power: {warn_v: 10.5}", "power.limit_v is missing: add it"),
    ("power: {warn_v: 70, limit_v: 9, stop_v: 8}", "power.warn_v = 70: it must be a number, 0"),
    ("inputs: {bumper_left: {pin: 34}}", "inputs.bumper_left = {'pin': 34}: unknown key; did you"),
    ("inputs: {cliff_front: 34}", "inputs.cliff_front = 34: it must be names with values"),
    ("inputs: {cliff: {pin: 34, pull: up}}", "inputs.cliff.pull = 'up': choose one of internal"),
    (
        "inputs: {stage_fault: {pin: 34, triggered: high}}",
        "inputs.stage_fault.triggered = 'high': a power stage's fault output is low",
    ),
]


@pytest.mark.parametrize(("sections", "words"), NOT_PERIPHERALS)
def test_what_is_no_peripheral_is_refused_by_file_line_key_and_value(
    sections: str, words: str, tmp_path: Path
) -> None:
    file = tmp_path / "board.yaml"
    file.write_text(BOARD + sections)
    with pytest.raises(ConfigurationError) as raised:
        load_board(file)
    assert str(raised.value).startswith(f"{file}, line 9: ")
    assert words in str(raised.value)


@pytest.mark.parametrize("section", ["imu", "power", "inputs"])
def test_a_section_may_be_empty(section: str) -> None:
    assert board_of(BOARD + f"{section}:\n").peripherals == ()


def test_each_kind_of_input_is_named_as_its_section() -> None:
    assert channel_name(PeripheralKind.CLIFF, Place.NONE) == "cliff"
    assert channel_name(PeripheralKind.BUMPER, Place.REAR_RIGHT) == "bumper.rear_right"
