"""The pictures of docs/wiring, which are drawn by hand, have the pins of boards/l298n.yaml."""

from __future__ import annotations

import re
from collections import defaultdict

from support.pages import ROOT
from wheelwire.tools.files.board import load_board

BOARD = load_board("l298n")
INPUTS = {
    "ENA": BOARD.left.enable,
    "IN1": BOARD.left.in1,
    "IN2": BOARD.left.in2,
    "IN3": BOARD.right.in1,
    "IN4": BOARD.right.in2,
    "ENB": BOARD.right.enable,
}
ENCODERS = {
    "left A": BOARD.left.encoder_a,
    "left B": BOARD.left.encoder_b,
    "right A": BOARD.right.encoder_a,
    "right B": BOARD.right.encoder_b,
}
SECOND_DEVKIT_Y = 586


def labels(picture: str) -> list[tuple[int, int, str]]:
    """x, y and text of each label of a picture."""
    drawn = (ROOT / "docs" / "wiring" / f"wiring-{picture}.svg").read_text("utf-8")
    texts = re.findall(r'<text x="(\d+)" y="(\d+)"[^>]*>([^<]*)</text>', drawn)
    return [(int(x), int(y), text) for x, y, text in texts]


def column(found: list[tuple[int, int, str]], top: str) -> list[str]:
    """What is below the label `top`, and above it, from the top."""
    (at,) = (x for x, _, text in found if text == top)
    return [text for x, _, text in sorted(found, key=lambda one: one[1]) if x == at]


def test_the_module_s_inputs_lead_to_the_pins() -> None:
    found = labels("module")
    assert {name: column(found, name)[-1] for name in INPUTS} == {
        name: str(pin) for name, pin in INPUTS.items()
    }
    assert BOARD.pulldowns == {BOARD.left.enable, BOARD.right.enable}  # "10 kOhm from each EN"


def test_each_devkit_s_pins_lead_where_the_board_says() -> None:
    shown: dict[tuple[bool, str], str] = {}
    rows: defaultdict[tuple[int, bool], list[tuple[int, str]]] = defaultdict(list)
    for x, y, text in labels("devkits"):
        rows[y, x > 210].append((abs(x - 210), text))
    for (y, _), row in rows.items():
        if len(row) == 2:  # nearer to the chip is the pin's name
            (_, pin), (_, use) = sorted(row)
            shown[y > SECOND_DEVKIT_Y, use] = pin
    uses = {**INPUTS, **ENCODERS, "e-stop": BOARD.estop, "LED": BOARD.led, "both VCC": "3V3"}
    assert shown == {(kit, use): str(pin) for kit in (False, True) for use, pin in uses.items()}


def test_the_plugs_have_the_encoders_pins() -> None:
    found = labels("plug")
    for phase in "AB":
        pins = [str(ENCODERS[f"{side} {phase}"]) for side in ("left", "right")]
        assert column(found, phase) == [phase, *pins]
    assert f"GPIO {BOARD.left.encoder_a}" in [text for *_, text in found]
