"""Boards as data: files, the packed struct, and the rules, each with its sentence."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from support.cases import each
from wheelwire.board import Configuration, DigitalInput, Pull, WheelPins, unpacked
from wheelwire.errors import ConfigurationError
from wheelwire.tools.files.board import (
    board_mapping,
    checked_board,
    load_board,
    parse_board,
    shipped_boards,
    to_yaml,
)
from wheelwire_protocol.board import (
    CHIPS,
    STAGES,
    Action,
    BoardFault,
    BoardLine,
    BoardPin,
    ContactKind,
    EncoderPulls,
    Level,
    Module,
    Stage,
)
from wheelwire_protocol.board_layout import BOARD, BOARD_SIZE
from wheelwire_protocol.codes import Chip
from wheelwire_protocol.sensors import PeripheralKind, Place, channel_name

PINS = st.none() | st.integers(0, 127)
WHEELS = st.builds(WheelPins, PINS, PINS, PINS, PINS, PINS, PINS, PINS)
BOARDS = st.builds(
    Configuration,
    name=st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=24),
    chip=st.sampled_from(list(CHIPS)),
    stage=st.sampled_from(Stage),
    left=WHEELS,
    right=WHEELS,
    standby=PINS,
    pwm_frequency_hz=st.integers(0, 65_535),
    encoder_pulls=st.sampled_from(EncoderPulls),
    encoder_filter_ns=st.integers(0, 65_535),
    estop=PINS,
    estop_contact=st.sampled_from(ContactKind),
    battery=PINS,
    battery_divider=st.integers(1, 65_535).map(lambda permille: permille / 1000),
    led=PINS,
    line=st.sampled_from(BoardLine),
    module=st.sampled_from(Module),
    pulldowns=st.frozensets(st.integers(0, 63)),
)

ESP32, S3, C6, PI = "l298n", "esp32s3", "esp32c6", "pi4b"

PULLED_UP = r"{0} = {1}: .* pulls GPIO {1} up while it starts, which may drive a motor"
HELD_HIGH = r"{0} = {1}: GPIO {1} of .* is high while it starts, which may drive a motor"

WRONG: list[tuple[str, dict[str, Any], str]] = [
    # The module
    (ESP32, {"module": "s3-quad"}, r"module: the ESP32 has no such module; leave it out"),
    (C6, {"module": "wrover"}, r"module: the ESP32-C6 has no such module"),
    (ESP32, {"module": "wrover", "right.encoder_a": 16}, r"GPIO 16 of the ESP32 leads to its"),
    (ESP32, {"module": "wroom-32", "left.in2": 6}, r"GPIO 6 of the ESP32 leads to its flash"),
    (S3, {"module": "s3-octal", "left.in2": 35}, r"GPIO 35 of the ESP32-S3 leads to its flash"),
    # The chip's pins
    (ESP32, {"left.enable": 34}, r"left\.enable = 34: GPIO 34 of the ESP32 is an input only"),
    (ESP32, {"right.in2": 39}, r"right\.in2 = 39: GPIO 39 of the ESP32 is an input only"),
    (ESP32, {"led": 36}, r"led = 36: GPIO 36 of the ESP32 is an input only"),
    (ESP32, {"left.in1": 0}, r"left\.in1 = 0: the level of GPIO 0 at reset selects how the ESP32"),
    (ESP32, {"left.in1": 2}, r"left\.in1 = 2: the level of GPIO 2 at reset"),
    (ESP32, {"left.encoder_b": 5}, r"left\.encoder_b = 5: the level of GPIO 5 at reset"),
    (ESP32, {"right.in1": 12}, r"right\.in1 = 12: the level of GPIO 12 at reset"),
    (ESP32, {"estop.pin": 15}, r"estop\.pin = 15: the level of GPIO 15 at reset"),
    (
        S3,
        {"left.in1": 45},
        r"left\.in1 = 45: the level of GPIO 45 at reset selects how the ESP32-S3",
    ),
    (C6, {"left.in1": 8}, r"left\.in1 = 8: the level of GPIO 8 at reset selects how the ESP32-C6"),
    (ESP32, {"left.in2": 6}, r"left\.in2 = 6: GPIO 6 of the ESP32 leads to its flash or PSRAM"),
    (ESP32, {"right.encoder_a": 16}, r"right\.encoder_a = 16: GPIO 16 of the ESP32 leads to its"),
    (S3, {"left.in2": 35}, r"left\.in2 = 35: GPIO 35 of the ESP32-S3 leads to its flash or PSRAM"),
    (C6, {"left.in2": 27}, r"left\.in2 = 27: GPIO 27 of the ESP32-C6 leads to its flash or PSRAM"),
    (
        ESP32,
        {"left.in1": 1},
        r"left\.in1 = 1: GPIO 1 of the ESP32 carries the line to the computer",
    ),
    (S3, {"led": 19}, r"led = 19: GPIO 19 of the ESP32-S3 carries the line to the computer"),
    (C6, {"left.in1": 17}, r"left\.in1 = 17: GPIO 17 of the ESP32-C6 carries the line"),
    (ESP32, {"left.in1": 24}, r"left\.in1 = 24: the ESP32 has no GPIO 24 on its pins"),
    (ESP32, {"left.in1": 40}, r"left\.in1 = 40: the ESP32 has no GPIO 40 on its pins"),
    (S3, {"left.in1": 22}, r"left\.in1 = 22: the ESP32-S3 has no GPIO 22 on its pins"),
    (PI, {"left.in1": 28}, r"left\.in1 = 28: the Raspberry Pi has no GPIO 28 on its pins"),
    # Pins used twice
    (ESP32, {"right.in1": 26}, r"right\.in1 = 26: GPIO 26 is left\.in1 already"),
    (ESP32, {"led": 18}, r"led = 18: GPIO 18 is left\.encoder_a already"),
    (PI, {"right.encoder_b": 17}, r"right\.encoder_b = 17: GPIO 17 is left\.encoder_a already"),
    # What a function needs
    (ESP32, {"left.encoder_a": 35}, r"left\.encoder_a = 35: GPIO 35 .* no pull-up of its own"),
    (ESP32, {"estop.pin": 34}, r"estop\.pin = 34: GPIO 34 of the ESP32 has no pull-up, so an open"),
    (ESP32, {"battery": {"pin": 21}}, r"battery\.pin = 21: GPIO 21 of the ESP32 cannot measure"),
    (S3, {"battery": {"pin": 12}}, r"battery\.pin = 12: GPIO 12 of the ESP32-S3 cannot measure"),
    (PI, {"battery": {"pin": 4}}, r"battery\.pin = 4: the Raspberry Pi has no support for it"),
    (PI, {"led": 4}, r"led = 4: the Raspberry Pi has no support for it; leave it out"),
    (ESP32, {"battery": {"pin": 34, "divider": 30}}, r"battery\.divider = 30000 thousandths"),
    # The stage
    (ESP32, {"left.in2": None}, r"left\.in2: the stage enable_in1_in2 needs this pin"),
    (ESP32, {"right.encoder_a": None}, r"right\.encoder_a: the stage enable_in1_in2 needs this"),
    ("tb6612", {"left.pwm": None}, r"left\.pwm: the stage pwm_in1_in2 needs this pin"),
    ("mdd10a", {"right.in1": 27}, r"right\.in1 = 27: the stage pwm_dir has no such input"),
    ("mdd10a", {"standby": 21}, r"standby = 21: the stage pwm_dir has no such input"),
    ("l298n", {"pulldowns": [25]}, r"right\.enable = 33: the stage enable_in1_in2 drives whenever"),
    ("bts7960", {"pulldowns": [33]}, r"left\.enable = 25: the stage half_bridges drives whenever"),
    (
        "mdd10a",
        {"pulldowns": [33]},
        r"left\.pwm = 25: the stage pwm_dir drives whenever this input",
    ),
    ("drv8833", {"pulldowns": [25]}, r"pulldowns: GPIO 25 is not an output of this board"),
    # What is high while the chip starts
    ("tb6612", {"left.in1": 14, "estop.pin": 26}, PULLED_UP.format("left.in1", 14)),
    ("drv8833", {"standby": 14, "estop.pin": 21}, PULLED_UP.format("standby", 14)),
    (PI, {"left.enable": 2}, HELD_HIGH.format("left.enable", 2)),
    (PI, {"right.enable": 3, "pulldowns": [3, 18]}, HELD_HIGH.format("right.enable", 3)),
    (PI, {"left.enable": 1}, HELD_HIGH.format("left.enable", 1)),
    (PI, {"left.enable": 14}, HELD_HIGH.format("left.enable", 14)),
    # Numbers
    ("mdd10a", {"pwm_frequency_hz": 25_000}, r"pwm_frequency_hz = 25000: .* pwm_dir takes 20000"),
    (
        "bts7960",
        {"pwm_frequency_hz": 30_000},
        r"= 30000: the stage half_bridges takes 25000 at most",
    ),
    (ESP32, {"pwm_frequency_hz": 60_000}, r"= 60000: the stage enable_in1_in2 takes 40000 at most"),
    (ESP32, {"pwm_frequency_hz": 50}, r"pwm_frequency_hz = 50: choose 100 at least"),
    (ESP32, {"encoder_filter_ns": 13_000}, r"encoder_filter_ns = 13000: the chip's filter ends at"),
    (ESP32, {"link": "usb"}, r"link: the ESP32 has no USB of its own"),
]

NOT_A_BOARD: list[tuple[dict[str, Any], str]] = [
    ({"name": None}, "name = None: it must be 1 to 24 ASCII characters"),
    ({"name": "x" * 25}, "it must be 1 to 24 ASCII characters"),
    ({"name": "Brücke"}, "it must be 1 to 24 ASCII characters"),
    ({"chip": "esp8266"}, "chip = 'esp8266': choose one of esp32, esp32s3, esp32c6, raspberry-pi"),
    ({"stage": "l298n"}, "stage = 'l298n': choose one of enable_in1_in2, "),
    ({"left.enable": "GPIO25"}, "left.enable = 'GPIO25': it must be the number of a GPIO"),
    ({"left.enable": -1}, "left.enable = -1: it must be the number of a GPIO"),
    ({"left.enable": True}, "left.enable = True: it must be the number of a GPIO"),
    ({"left.enabel": 25}, "left.enabel = 25: unknown key; did you mean left.enable?"),
    ({"pulldown": [25]}, "pulldown = [25]: unknown key; did you mean pulldowns?"),
    ({"pulldowns": 25}, "pulldowns = 25: give a list of GPIO numbers, 0 to 63"),
    ({"pulldowns": [64]}, "pulldowns = [64]: give a list of GPIO numbers, 0 to 63"),
    ({"estop": 14}, "estop = 14: it must be names with values"),
    ({"estop.contact": "open"}, "estop.contact = 'open': choose one of normally_closed, "),
    ({"battery": {"pin": 34, "divider": "4"}}, "battery.divider = '4': it must be a number"),
    ({"battery": {"pin": 34, "divider": math.inf}}, "battery.divider = inf: it must be a number"),
    ({"pwm_frequency_hz": 2.5}, "pwm_frequency_hz = 2.5: it must be a whole number"),
    ({"link": "wifi"}, "link = 'wifi': choose one of uart, usb"),
    ({"left": None}, "left = None: it must be names with values"),
]


def changed(name: str, changes: dict[str, Any]) -> dict[str, Any]:
    """The content of a built-in board's file with some values changed; None removes a pin."""
    content = board_mapping(load_board(name))
    for key, value in changes.items():
        section, _, inner = key.rpartition(".")
        target = content.setdefault(section, {}) if section else content
        if value is None and section:
            del target[inner]
        else:
            target[inner] = value
    return content


@pytest.mark.parametrize("name", shipped_boards())
def test_a_built_in_board_can_be_used(name: str) -> None:
    board = load_board(name)
    assert board.problems() == []
    assert checked_board(name) == board


def test_there_is_a_board_for_every_stage_and_chip() -> None:
    boards = [load_board(name) for name in shipped_boards()]
    assert {board.stage for board in boards} == set(Stage)
    assert {board.chip for board in boards} == set(CHIPS)


def test_a_name_that_is_too_long_is_not_cut() -> None:
    board = replace(load_board("l298n"), name="L298N on the blue robot's own board")
    with pytest.raises(ConfigurationError, match=r"blue robot.*1 to 24 characters"):
        board.packed()


@pytest.mark.parametrize(
    ("like", "chip", "pin"),
    [
        ("tb6612", Chip.ESP32, 14),
        ("tb6612", Chip.ESP32S3, 39),
        ("tb6612", Chip.ESP32C6, 23),
        ("tb6612", Chip.LINUX, 4),
        ("drv8833", Chip.LINUX, 8),
        ("l298n", Chip.LINUX, 7),
    ],
)
def test_a_pull_down_wins_over_a_weak_pull_up(like: str, chip: Chip, pin: int) -> None:
    board = replace(load_board(like), chip=chip)
    name = "enable" if like == "l298n" else "in1"
    board = replace(board, left=replace(board.left, **{name: pin}))

    def about_it(pulldowns: frozenset[int]) -> list[str]:
        problems = replace(board, pulldowns=pulldowns).problems()
        return [problem for problem in problems if problem.startswith(f"left.{name} = ")]

    assert about_it(frozenset())
    assert about_it(frozenset({pin})) == []


def test_an_input_that_may_be_high_while_the_stage_is_released_may_be_on_a_pulled_up_pin() -> None:
    content = changed("l298n", {"left.in1": 14, "estop.pin": 26})
    assert parse_board(content).problems() == []


@pytest.mark.parametrize("chip", CHIPS)
def test_the_levels_of_a_chip_while_it_starts_are_of_pins_that_it_has(chip: Chip) -> None:
    table = CHIPS[chip]
    assert table.pulled_up | table.held_high <= table.existing - table.input_only
    assert not table.pulled_up & table.held_high
    assert "data sheet" in table.levels_source or "ARM Peripherals" in table.levels_source


def test_there_are_forty_wrong_boards() -> None:
    assert len(WRONG) >= 40


@each(("name", "changes", "words"), WRONG)
def test_a_wrong_board_is_refused_by_its_own_sentence(
    name: str, changes: dict[str, Any], words: str
) -> None:
    problems = parse_board(changed(name, changes)).problems()
    assert any(re.search(words, problem) for problem in problems), problems
    # A pin that moved leaves its resistor behind, nothing else is wrong.
    others = [p for p in problems if not re.search(words, p)]
    assert all("pulldowns: GPIO" in p or "drives whenever" in p for p in others), others


@pytest.mark.parametrize(
    ("name", "module", "pins"), [(ESP32, "wroom-32", (16, 17)), (S3, "s3-quad", range(33, 38))]
)
def test_a_module_that_is_named_leaves_its_pins_free(
    name: str, module: str, pins: tuple[int, ...]
) -> None:
    for pin in pins:
        on_any = parse_board(changed(name, {"left.encoder_a": pin}))
        assert "name the module" in on_any.problems()[0]
        named = parse_board(changed(name, {"left.encoder_a": pin, "module": module}))
        assert named.problems() == []
        assert board_mapping(named)["module"] == module
        assert unpacked(named.packed()) == named
        assert named.fingerprint() != on_any.fingerprint()


@pytest.mark.parametrize(("name", "pin"), [(ESP32, 2), (S3, 45), (C6, 8)])
def test_an_led_on_a_strap_is_a_warning(name: str, pin: int) -> None:
    board = parse_board(changed(name, {"led": pin}))
    assert board.problems() == []
    (warning,) = board.warnings()
    assert f"led = {pin}: the level of GPIO {pin} at reset" in warning


def test_a_contact_that_fails_silently_is_a_warning() -> None:
    assert parse_board(changed(ESP32, {})).warnings() == []
    board = parse_board(changed(ESP32, {"estop.contact": "normally_open"}))
    assert board.problems() == []
    (warning,) = board.warnings()
    assert "normally open" in warning
    no_contact = replace(board, estop=None)
    assert no_contact.warnings() == []


@pytest.mark.parametrize("triggered_low", [False, True])
@pytest.mark.parametrize("pull", list(Pull))
@pytest.mark.parametrize("kind", [PeripheralKind.CLIFF, PeripheralKind.STAGE_FAULT])
def test_an_input_whose_broken_wire_looks_safe_is_a_warning(
    kind: PeripheralKind, pull: Pull, triggered_low: bool
) -> None:
    place = Place.FRONT if kind is PeripheralKind.CLIFF else Place.NONE
    entry = DigitalInput(kind, place, 36, triggered_low, pull)
    found = replace(parse_board(changed(ESP32, {})), peripherals=(entry,)).warnings()
    safe = (pull, triggered_low) in ((Pull.INTERNAL, False), (Pull.DOWN, True))
    assert len(found) == (0 if safe else 1)
    if found:
        assert channel_name(kind, place) in found[0]
        assert ("resistors" in found[0]) == (pull is Pull.EXTERNAL)


def test_every_rule_that_a_file_can_break_is_broken_by_one() -> None:
    beyond_files = {
        BoardFault.NONE,
        BoardFault.VERSION,
        BoardFault.DAMAGED,
        BoardFault.NAME,
        BoardFault.CHIP,
        BoardFault.OTHER_CHIP,
        BoardFault.STAGE,
        BoardFault.CODE,
        # No chip of today has too few for two wheels: firmware/esp32/test/board_rules_test.cpp.
        BoardFault.COUNTERS,
        BoardFault.PWM_OUTPUTS,
        BoardFault.LED_ON_STRAP,  # a warning
    }
    broken = set()
    for name, changes, _ in WRONG:
        texts = parse_board(changed(name, changes)).problems()
        for fault in BoardFault:
            pattern = re.sub(r"\\\{\w+\\\}", ".*", re.escape(fault.doc))
            broken |= {fault} if any(re.fullmatch(pattern, text) for text in texts) else set()
    assert set(BoardFault) - broken == beyond_files


@each(("changes", "words"), NOT_A_BOARD)
def test_an_invalid_board_is_refused_by_key_and_value(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError, match=re.escape(words)):
        parse_board(changed(ESP32, changes))


@pytest.mark.parametrize("missing", ["name", "chip", "stage", "left", "right"])
def test_a_missing_key_is_named(missing: str) -> None:
    content = board_mapping(load_board(ESP32))
    del content[missing]
    with pytest.raises(ConfigurationError, match=f"^{missing} is missing"):
        parse_board(content)


@given(BOARDS)
def test_a_board_survives_the_way_to_bytes_and_back(board: Configuration) -> None:
    assert unpacked(board.packed()) == board


@given(BOARDS)
def test_a_board_survives_the_way_to_yaml_and_back(board: Configuration) -> None:
    # Without its pin a contact or a divider says nothing.
    kept = parse_board(yaml.safe_load(to_yaml(board)))
    assert to_yaml(kept) == to_yaml(board)
    assert kept.left == board.left
    assert kept.pulldowns == board.pulldowns


@given(BOARDS)
def test_the_core_checks_any_board(board: Configuration) -> None:
    assert all(problem and "{" not in problem for problem in board.problems())


@given(BOARDS)
def test_the_packed_board_is_what_construct_makes_of_it(board: Configuration) -> None:
    parsed = BOARD.parse(board.packed()[:BOARD_SIZE])
    assert parsed.version == 1
    assert parsed.name.rstrip(b"\0").decode() == board.name
    assert {f: parsed[f.name.lower()] for f in BoardPin} == {
        f: -1 if (pin := board.pin(f)) is None else pin for f in BoardPin
    }
    assert BOARD.build(parsed) == board.packed()[:BOARD_SIZE]


def test_a_damaged_board_is_not_read() -> None:
    packed = load_board(ESP32).packed()
    for index in range(len(packed)):
        damaged = bytearray(packed)
        damaged[index] ^= 0x10
        with pytest.raises(ConfigurationError, match="checksum is wrong"):
            unpacked(bytes(damaged))
    with pytest.raises(ConfigurationError, match="checksum is wrong"):
        unpacked(packed[:-1])


def test_a_board_of_another_chip_and_stage_is_shown_as_it_is() -> None:
    board = unpacked(load_board("esp32c6").packed())
    assert (board.chip, board.stage) == (Chip.ESP32C6, Stage.ENABLE_IN1_IN2)


def test_an_unknown_board_names_those_that_there_are() -> None:
    with pytest.raises(ConfigurationError, match=r"the built-in boards are bts7960, .*tb6612"):
        load_board("no-such-board")


@pytest.mark.parametrize("stage", Stage)
def test_no_row_of_a_truth_table_leaves_an_input_open(stage: Stage) -> None:
    table = STAGES[stage]
    for action in (Action.FORWARD, Action.REVERSE, Action.BRAKE):
        assert set(table.rows[action]) == set(table.inputs)
        assert Level.KEEP not in table.rows[action].values()
    assert set(table.pull_downs) <= set(table.inputs)
    # What floats low, or is held low, must not drive.
    assert all(table.rows[Action.COAST][pin] in (Level.LOW, Level.KEEP) for pin in table.inputs)
