"""One simulated wheel: the pins of its bridge in, the edges of its encoder out."""

from __future__ import annotations

from collections.abc import Iterator

from .encoder import Edge, Encoder
from .motor import Motor, MotorModel


class SimulatedWheel:
    """Motor and encoder on one axle. Set `motor` and `encoder` attributes to break it."""

    def __init__(self, model: MotorModel, counts_per_revolution: int) -> None:
        self.motor = Motor(model)
        self.encoder = Encoder(counts_per_revolution)
        self.in1 = self.in2 = False
        self.enable = 0.0
        """PWM duty on EN."""

    def set_inputs(self, in1: bool, in2: bool) -> None:
        """The levels of IN1 and IN2."""
        self.in1, self.in2 = in1, in2

    def set_enable(self, duty: float) -> None:
        """PWM on EN, 0..1."""
        self.enable = duty

    @property
    def driven(self) -> bool:
        """Whether the motor is driven; braking is not driving."""
        return self.enable > 0 and self.in1 != self.in2

    def step(self, dt_s: float) -> Iterator[Edge]:
        """Advance by at most `motor.LONGEST_STEP_S`; yields the encoder's edges."""
        return self.encoder.turn(self.motor.step(dt_s, self.in1, self.in2, self.enable))
