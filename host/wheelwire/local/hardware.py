"""What the control loop needs from the pins. Each driver brings its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple


class BridgePins(ABC):
    """The pins of one half of an L298N. Raises `LinkLost` when they are out of reach."""

    @abstractmethod
    def set_inputs(self, in1: bool, in2: bool) -> None:
        """The levels of IN1 and IN2."""

    @abstractmethod
    def set_enable(self, duty: float) -> None:
        """PWM on EN, 0..1; 0 is low."""


class WheelPair(NamedTuple):
    """One count for each wheel."""

    left: int
    right: int


class Hardware(ABC):
    """The pins of one robot, opened. All methods raise `LinkLost` when they are out of reach.

    Attributes:
        left: The left wheel's half of the bridge.
        right: The right wheel's half.
        limits: What this wiring cannot do, in sentences.
    """

    left: BridgePins
    right: BridgePins
    limits: tuple[str, ...] = ()

    @abstractmethod
    def ticks(self) -> WheelPair:
        """Cumulative x4 ticks, forward (A before B) positive."""

    @abstractmethod
    def illegal_transitions(self) -> WheelPair:
        """How often an edge was lost, as far as the decoders can tell."""

    def estop_is_open(self) -> bool:
        """The normally-closed e-stop contact; open where none is fitted."""
        return True

    def keep_alive(self, now_us: int) -> None:  # noqa: B027 - most have no one to tell
        """Called each control step: tells whoever watches this program that it lives."""

    @abstractmethod
    def close(self) -> None:
        """Let both wheels coast and give back the pins. Raises nothing."""
