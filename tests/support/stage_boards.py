"""A Raspberry Pi with each kind of power stage."""

from __future__ import annotations

from dataclasses import replace

from wheelwire.board import Configuration, WheelPins
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.power_stages import STAGES, Stage

PI = load_board("pi4b")
PINS = {"enable": (12, 13), "in1": (23, 20), "in2": (24, 21), "pwm": (18, 19), "dir": (23, 20)}
"""Of each input, left and right."""
STANDBY = 25


def board_of(stage: Stage, standby: int | None = None) -> Configuration:
    """One with this stage, each of whose inputs has a pin of its own."""
    left, right = (
        WheelPins(
            encoder_a=wheel.encoder_a,
            encoder_b=wheel.encoder_b,
            **{name: PINS[name][side] for name in STAGES[stage].inputs},
        )
        for side, wheel in enumerate((PI.left, PI.right))
    )
    pulldowns = frozenset(pin for name in STAGES[stage].pull_downs for pin in PINS[name])
    board = replace(PI, name=stage.name, stage=stage, left=left, right=right)
    return replace(board, standby=standby, pulldowns=pulldowns)
