"""The interface to the pins, implemented by each backend."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from wheelwire_protocol.native import Bridge

from ...errors import DriverUnavailable

FULL_ENABLE = 32767
"""The core's number for a PWM on EN that is always on."""


class PinsBusy(DriverUnavailable):
    """Another process holds a pin. A process that is ending releases it when it has braked."""


class WheelPair(NamedTuple):
    """One count for each wheel."""

    left: int
    right: int


class HalfBridge(ABC):
    """The pins of one half of an L298N. Raises `LinkLost` if they can no longer be reached."""

    def __init__(self) -> None:
        self._inputs: tuple[bool, bool] | None = None

    def apply(self, levels: Bridge) -> None:
        """Set the pins as the core says. EN is low whenever the inputs change."""
        inputs = (levels.in1, levels.in2)
        if inputs != self._inputs:
            self.set_enable(0.0)
            self.set_inputs(*inputs)
            self._inputs = inputs
        self.set_enable(levels.enable_q15 / FULL_ENABLE)

    @abstractmethod
    def set_inputs(self, in1: bool, in2: bool) -> None:
        """Set the levels of IN1 and IN2."""

    @abstractmethod
    def set_enable(self, duty: float) -> None:
        """Set the PWM on EN, 0..1; 0 is low."""


class Gpio(ABC):
    """The opened pins of one robot. Methods raise `LinkLost` if they can no longer be reached.

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
        """How many impossible changes the decoders have seen, each a lost edge."""

    @abstractmethod
    def contact_is_open(self) -> bool:
        """Whether the normally-closed e-stop contact is open; true if none is fitted."""

    def keep_alive(self, now_us: int) -> None:  # noqa: B027 - only pigpio has a watchdog
        """Called in each control step: refresh the backend's watchdog, if it has one."""

    @abstractmethod
    def close(self) -> None:
        """Let both wheels coast and release the pins. Raises nothing."""
