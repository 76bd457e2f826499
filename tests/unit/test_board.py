"""Boards as data: files, the packed struct, and the rules, each with its sentence."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
import yaml
from construct import Struct
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
    BoardFault,
    BoardLine,
    BoardPin,
    ContactKind,
    EncoderPulls,
    Module,
)
from wheelwire_protocol.board_layout import BOARD_SIZE, Board
from wheelwire_protocol.codes import Chip, PeripheralKind, Place, channel_name
from wheelwire_protocol.message import fields_of
from wheelwire_protocol.power_stages import STAGES, Action, Level, Stage

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

Fault = BoardFault


@dataclass(frozen=True)
class Wrong:
    """A built-in board with a value that breaks a rule.

    Args:
        fields: What the rule's sentence names, where it is not the changed value of this board.
    """

    board: str
    fault: BoardFault
    changes: dict[str, Any]
    fields: dict[str, object] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        board = load_board(self.board)
        key, value = next(iter(self.changes.items()))
        named = {"function": key, "pin": value, "value": value, "chip": CHIPS[board.chip].title}
        named["stage"] = board.stage.name.lower()
        return self.fault.doc.format(**{**named, **self.fields})


WRONG = [
    # The module
    Wrong(C6, Fault.MODULE, {"module": "wrover"}),
    Wrong(ESP32, Fault.PIN_OF_MEMORY, {"left.in2": 6, "module": "wroom-32"}),
    Wrong(S3, Fault.PIN_OF_MEMORY, {"left.in2": 35, "module": "s3-octal"}),
    # The chip's pins
    Wrong(ESP32, Fault.PIN_INPUT_ONLY, {"left.enable": 34}),
    Wrong(ESP32, Fault.PIN_STRAPPING, {"left.in1": 0}),
    Wrong(S3, Fault.PIN_STRAPPING, {"left.in1": 45}),
    Wrong(C6, Fault.PIN_STRAPPING, {"left.in1": 8}),
    Wrong(ESP32, Fault.PIN_OF_MEMORY, {"left.in2": 6}),
    Wrong(S3, Fault.PIN_OF_MEMORY, {"left.in2": 35}),
    Wrong(C6, Fault.PIN_OF_MEMORY, {"left.in2": 27}),
    Wrong(ESP32, Fault.PIN_OF_LINK, {"left.in1": 1}),
    Wrong(S3, Fault.PIN_OF_LINK, {"led": 19}),
    Wrong(C6, Fault.PIN_OF_LINK, {"left.in1": 17}),
    Wrong(ESP32, Fault.PIN_ABSENT, {"left.in1": 24}),
    Wrong(S3, Fault.PIN_ABSENT, {"left.in1": 22}),
    Wrong(PI, Fault.PIN_ABSENT, {"left.in1": 28}),
    # Pins used twice
    Wrong(ESP32, Fault.PIN_TWICE, {"right.in1": 26}, {"other": "left.in1"}),
    Wrong(PI, Fault.PIN_TWICE, {"right.encoder_b": 17}, {"other": "left.encoder_a"}),
    # What a function needs
    Wrong(ESP32, Fault.NO_PULL_UP, {"left.encoder_a": 35}),
    Wrong(ESP32, Fault.NO_PULL_UP_FOR_CONTACT, {"estop.pin": 34}),
    Wrong(ESP32, Fault.NO_ADC, {"battery.pin": 21}),
    Wrong(S3, Fault.NO_ADC, {"battery.pin": 12}),
    Wrong(PI, Fault.NOT_ON_THIS_CHIP, {"battery.pin": 4}),
    Wrong(ESP32, Fault.DIVIDER, {"battery.divider": 30, "battery.pin": 34}, {"value": 30_000}),
    # The stage
    Wrong("tb6612", Fault.PIN_MISSING, {"left.pwm": None}),
    Wrong("mdd10a", Fault.PIN_WITHOUT_USE, {"right.in1": 27}),
    Wrong(ESP32, Fault.NO_PULL_DOWN, {"pulldowns": [25]}, {"function": "right.enable", "pin": 33}),
    Wrong("drv8833", Fault.PULL_DOWN_WITHOUT_USE, {"pulldowns": [25]}, {"pin": 25}),
    # What is high while the chip starts
    Wrong("tb6612", Fault.PIN_PULLED_UP, {"left.in1": 14, "estop.pin": 26}),
    Wrong(PI, Fault.PIN_HELD_HIGH, {"left.enable": 2}),
    # Numbers
    Wrong("mdd10a", Fault.FREQUENCY_HIGH, {"pwm_frequency_hz": 25_000}, {"limit": 20_000}),
    Wrong(ESP32, Fault.FREQUENCY_HIGH, {"pwm_frequency_hz": 60_000}, {"limit": 40_000}),
    Wrong(ESP32, Fault.FREQUENCY_LOW, {"pwm_frequency_hz": 50}, {"limit": 100}),
    Wrong(ESP32, Fault.FILTER, {"encoder_filter_ns": 13_000}, {"limit": 12_787}),
    Wrong(ESP32, Fault.LINE, {"link": "usb"}),
]
NOT_A_BOARD: list[tuple[dict[str, Any], str]] = [
    ({"name": "Brücke"}, "it must be 1 to 24 ASCII characters"),
    ({"chip": "esp8266"}, "chip = 'esp8266': choose one of esp32, esp32s3, esp32c6, raspberry-pi"),
    ({"stage": "l298n"}, "stage = 'l298n': choose one of enable_in1_in2, "),
    ({"left.enable": "GPIO25"}, "left.enable = 'GPIO25': it must be the number of a GPIO"),
    ({"left.enable": True}, "left.enable = True: it must be the number of a GPIO"),
    ({"left.enabel": 25}, "left.enabel = 25: unknown key; did you mean left.enable?"),
    ({"pulldown": [25]}, "pulldown = [25]: unknown key; did you mean pulldowns?"),
    ({"pulldowns": 25}, "pulldowns = 25: give a list of GPIO numbers, 0 to 63"),
    ({"estop": 14}, "estop = 14: it must be names with values"),
    ({"estop.contact": "open"}, "estop.contact = 'open': choose one of normally_closed, "),
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


@pytest.mark.parametrize("chip", CHIPS)
def test_the_levels_of_a_chip_while_it_starts_are_of_pins_that_it_has(chip: Chip) -> None:
    table = CHIPS[chip]
    assert table.pulled_up | table.held_high <= table.existing - table.input_only
    assert not table.pulled_up & table.held_high
    assert "data sheet" in table.levels_source or "ARM Peripherals" in table.levels_source


@each("wrong", WRONG, ids=lambda wrong: wrong.sentence)
def test_a_wrong_board_is_refused_by_its_own_sentence(wrong: Wrong) -> None:
    problems = parse_board(changed(wrong.board, wrong.changes)).problems()
    assert wrong.sentence in problems
    # A pin that moved leaves its resistor behind, nothing else is wrong.
    others = [problem for problem in problems if problem != wrong.sentence]
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
    assert set(BoardFault) - {wrong.fault for wrong in WRONG} == beyond_files


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
    # The core checks any board.
    assert all(problem and "{" not in problem for problem in board.problems())


@given(BOARDS)
def test_a_board_survives_the_way_to_yaml_and_back(board: Configuration) -> None:
    # Without its pin a contact or a divider says nothing.
    kept = parse_board(yaml.safe_load(to_yaml(board)))
    assert to_yaml(kept) == to_yaml(board)
    assert kept.left == board.left
    assert kept.pulldowns == board.pulldowns


@given(BOARDS)
def test_the_packed_board_is_what_construct_makes_of_it(board: Configuration) -> None:
    layout = Struct(*fields_of(Board))
    parsed = layout.parse(board.packed()[:BOARD_SIZE])
    assert parsed.version == 1
    assert parsed.name.rstrip(b"\0").decode() == board.name
    assert {f: parsed[f.name.lower()] for f in BoardPin} == {
        f: -1 if (pin := board.pin(f)) is None else pin for f in BoardPin
    }
    assert layout.build(parsed) == board.packed()[:BOARD_SIZE]


def test_a_damaged_board_is_not_read() -> None:
    packed = load_board(ESP32).packed()
    for index in range(len(packed)):
        damaged = bytearray(packed)
        damaged[index] ^= 0x10
        with pytest.raises(ConfigurationError, match="checksum is wrong"):
            unpacked(bytes(damaged))
    with pytest.raises(ConfigurationError, match="checksum is wrong"):
        unpacked(packed[:-1])


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
