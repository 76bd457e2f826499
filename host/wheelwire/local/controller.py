"""One wheel's velocity loop: feed-forward, and a PI controller for what it does not know."""

from __future__ import annotations

from math import copysign

from .settings import Gains


class Controller:
    """As the firmware's; call `update` once per control step."""

    def __init__(self) -> None:
        self.saturated_steps = 0
        """How often the output could not give what was wanted."""
        self._last_target_mps = 0.0
        self._integral = 0.0

    def reset(self, measured_mps: float) -> None:
        """Forget what was learned; the wheel moves at `measured_mps`."""
        self._integral = 0.0
        self._last_target_mps = measured_mps

    def update(self, target_mps: float, measured_mps: float, gains: Gains) -> float:
        """The duty of this step."""
        change = target_mps - self._last_target_mps
        self._last_target_mps = target_mps
        # On a ramp the measurement is compared with the target of its own time.
        error = target_mps - change * gains.delay_steps - measured_mps
        wanted = (
            (copysign(gains.static, target_mps) if target_mps else 0.0)
            + gains.feedforward * target_mps
            + gains.acceleration * change
            + gains.proportional * error
            + self._integral
        )
        duty = max(-gains.limit, min(gains.limit, wanted))
        self.saturated_steps += duty != wanted
        # Anti-windup: what the output cannot give is not asked for more and more.
        if duty == wanted or error * wanted <= 0:
            integral = self._integral + gains.integral * error
            self._integral = max(-gains.limit, min(gains.limit, integral))
        return duty
