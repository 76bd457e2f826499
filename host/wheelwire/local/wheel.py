"""One wheel: what it has turned, how fast it turns, what drives it, what is wrong with it."""

from __future__ import annotations

from .bridge import L298nStage
from .controller import Controller
from .fault_monitor import FaultMonitor, WheelFault
from .settings import ControlSettings, Gains, Inversions
from .velocity import VelocityEstimator


class Wheel:
    """On the robot's side of the wiring's inversions.

    Args:
        stage: What drives it.
        counter: The encoder's count now, which is no travel.
    """

    def __init__(self, stage: L298nStage, counter: int) -> None:
        self.ticks = 0
        """Since the start, forward positive."""
        self.velocity_mps = 0.0
        self.duty = 0.0
        """On the output, forward positive; 0 when not driving."""
        self._stage = stage
        self._counter = counter
        self._estimator = VelocityEstimator()
        self._controller = Controller()
        self._monitor = FaultMonitor()

    @property
    def saturated_steps(self) -> int:
        """How often the velocity loop wanted more than the output gives."""
        return self._controller.saturated_steps

    def latch(
        self, counter: int, now_us: int, inversions: Inversions, settings: ControlSettings
    ) -> WheelFault | None:
        """Take a reading of the encoder; returns what it says of the wheel's health."""
        change = self._counter - counter if inversions.encoder else counter - self._counter
        self._counter = counter
        self.ticks += change
        self._estimator.update(change, now_us, settings.velocity_window_us)
        self.velocity_mps = self._estimator.ticks_per_s * settings.metres_per_tick
        return self._monitor.update(
            self.duty, self.ticks, self.velocity_mps, now_us, settings.faults
        )

    def drive_velocity(self, target_mps: float, inversions: Inversions, gains: Gains) -> None:
        """Closed loop, one control step."""
        if target_mps == 0 and self.velocity_mps == 0:
            # Arrived at rest: shorted windings hold better than an integrator that hums.
            self.brake()
            return
        self.drive_duty(self._controller.update(target_mps, self.velocity_mps, gains), inversions)

    def drive_duty(self, duty: float, inversions: Inversions) -> None:
        """Open loop."""
        self.duty = duty
        self._stage.drive(-duty if inversions.motor else duty)

    def brake(self) -> None:
        """Short the windings."""
        self._rest()
        self._stage.brake()

    def coast(self) -> None:
        """Outputs off."""
        self._rest()
        self._stage.coast()

    def _rest(self) -> None:
        self._controller.reset(self.velocity_mps)
        self._monitor.reset()
        self.duty = 0.0
