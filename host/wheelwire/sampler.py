"""State frames into samples: each once, in order, on the host's clock as well. Sans-IO."""

from __future__ import annotations

from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import WheelState

from .clock import ClockEstimator
from .samples import WheelSample

DUTY_SCALE = 32767


class Sampler:
    """Turns the state frames of a link into samples, across its sessions."""

    def __init__(self) -> None:
        self.stale = 0
        """Frames that were repeated, or older than the newest."""
        self._newest: tuple[int, int] | None = None

    def sample(self, state: WheelState, clock: ClockEstimator, now_us: int) -> WheelSample | None:
        """The sample of a state frame that came at `now_us`; None when it is not a new one.

        Raises:
            ValueError: A code in it means nothing.
        """
        t_us = clock.unwrap(state.t_us, now_us)
        if self._newest is not None:
            boot_id, newest_us = self._newest
            if boot_id == state.boot_id and t_us <= newest_us:
                self.stale += 1
                return None
        host_us, error_us = clock.device_to_host(t_us)
        sample = WheelSample(
            boot_id=state.boot_id,
            t_us=t_us,
            left_ticks=state.left_ticks,
            right_ticks=state.right_ticks,
            left_mps=state.left_mps,
            right_mps=state.right_mps,
            left_duty=state.left_duty_q15 / DUTY_SCALE,
            right_duty=state.right_duty_q15 / DUTY_SCALE,
            command_seq=state.command_seq,
            state=SupervisorState(state.supervisor),
            faults=Fault(state.faults),
            overruns=state.overruns,
            battery_v=state.battery_mv / 1000 if state.battery_mv else None,
            stamp=host_us / 1e6,
            stamp_error_s=error_us / 1e6,
        )
        self._newest = (state.boot_id, t_us)
        return sample
