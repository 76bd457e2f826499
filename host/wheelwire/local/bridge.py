"""One half of an L298N: duty in, pins out."""

from __future__ import annotations

import enum

from .hardware import BridgePins


class Inputs(enum.Enum):
    """(IN1, IN2). With EN high equal inputs brake; EN low coasts whatever they are."""

    FORWARD = (True, False)
    REVERSE = (False, True)
    BRAKE = (False, False)


class L298nStage:
    """Orders the pins' changes so that the inputs never switch under current.

    A change of direction spends one control step with EN low; call once per control step.
    """

    def __init__(self, pins: BridgePins) -> None:
        self._pins = pins
        self._inputs: Inputs | None = None
        self._enabled = False

    def drive(self, duty: float) -> None:
        """-1..1, forward positive; 0 coasts."""
        if duty == 0:
            self.coast()
        elif self._switch(Inputs.FORWARD if duty > 0 else Inputs.REVERSE):
            self._enable(abs(duty))

    def brake(self) -> None:
        """Short the windings."""
        if self._switch(Inputs.BRAKE):
            self._enable(1.0)

    def coast(self) -> None:
        """Outputs off; safe at any time."""
        self._pins.set_enable(0.0)
        self._enabled = False

    def _enable(self, duty: float) -> None:
        self._pins.set_enable(duty)
        self._enabled = True

    def _switch(self, wanted: Inputs) -> bool:
        """True when the inputs are as wanted; False when this step had to be spent with EN low."""
        if self._inputs is wanted:
            return True
        if self._enabled:
            self.coast()
            return False
        self._pins.set_inputs(*wanted.value)
        self._inputs = wanted
        return True
