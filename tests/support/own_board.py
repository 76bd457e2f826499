"""The board that a simulated robot is on until another one is written to it."""

from __future__ import annotations

from dataclasses import replace

from wheelwire.tools.files.board import load_board
from wheelwire_protocol.board import Module

OWN_BOARD = replace(
    load_board("l298n"), name="L298N, simulated", module=Module.WROOM_32, battery=34
)
