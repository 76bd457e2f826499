"""What the core's process needs of the pins. Each backend brings its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from wheelwire_protocol.native import Bridge

from ...errors import DriverUnavailable

FULL_ENABLE = 32767
"""Duty of the PWM on EN as the core gives it."""


class PinsBusy(DriverUnavailable):
    """Another process holds a pin; one that was just told to end lets it go within its brake."""


class WheelPair(NamedTuple):
    """One count for each wheel."""

    left: int
    right: int


class HalfBridge(ABC):
    """The pins of one half of an L298N. Raises `LinkLost` when they are out of reach."""

    def __init__(self) -> None:
        self._inputs: tuple[bool, bool] | None = None

    def apply(self, levels: Bridge) -> None:
        """Make the pins what the core says. The inputs never switch under current."""
        inputs = (levels.in1, levels.in2)
        if inputs != self._inputs:
            self.set_enable(0.0)
            self.set_inputs(*inputs)
            self._inputs = inputs
        self.set_enable(levels.enable_q15 / FULL_ENABLE)

    @abstractmethod
    def set_inputs(self, in1: bool, in2: bool) -> None:
        """The levels of IN1 and IN2."""

    @abstractmethod
    def set_enable(self, duty: float) -> None:
        """PWM on EN, 0..1; 0 is low."""


class Gpio(ABC):
    """The pins of one robot, opened. All methods raise `LinkLost` when they are out of reach.

    Attributes:
        left: The left wheel's half of the bridge.
        right: The right wheel's half.
        limits: What this wiring cannot do, in sentences.
    """

    left: HalfBridge
    right: HalfBridge
    limits: tuple[str, ...] = ()

    @abstractmethod
    def ticks(self) -> WheelPair:
        """Cumulative x4 ticks, forward (A before B) positive."""

    @abstractmethod
    def illegal_transitions(self) -> WheelPair:
        """How often an edge was lost, as far as the decoders can tell."""

    @abstractmethod
    def contact_is_open(self) -> bool:
        """The normally-closed e-stop contact; open where none is fitted."""

    def keep_alive(self, now_us: int) -> None:  # noqa: B027 - most have no one to tell
        """Called each control step: tells whoever watches this process that it lives."""

    @abstractmethod
    def close(self) -> None:
        """Let both wheels coast and give back the pins. Raises nothing."""
