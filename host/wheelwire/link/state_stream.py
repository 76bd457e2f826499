"""State frames into samples: none twice, in order, on the host's clock as well. Sans-IO."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import WheelState

from ..samples import WheelSample
from .clock import ClockEstimator

DUTY_SCALE = 32767

# By a dictionary, in a seventh of the time: this is done for each sample.
_supervisor_state = cache(SupervisorState)
_fault = cache(Fault)


class Sampler:
    """Turns the state frames of a link into samples, across its sessions."""

    def __init__(self) -> None:
        self.stale = 0
        """Frames that were repeated, or older than the newest."""
        self._boot_id: int | None = None
        self._t_us = 0

    def sample(
        self, states: Iterable[WheelState], clock: ClockEstimator, now_us: int
    ) -> WheelSample | None:
        """The sample of the newest of the state frames that came at `now_us`; None if none is new.

        The others are not made into samples: nobody could tell them from the newest in time.

        Raises:
            ValueError: A code in it means nothing.
        """
        newest = None
        for state in states:
            if self._is_new(state, clock.unwrap(state.t_us, now_us)):
                newest = state
        return None if newest is None else self._sample(newest, clock)

    def _is_new(self, state: WheelState, t_us: int) -> bool:
        is_new = state.boot_id != self._boot_id or t_us > self._t_us
        if is_new:
            self._boot_id, self._t_us = state.boot_id, t_us
        else:
            self.stale += 1
        return is_new

    def _sample(self, state: WheelState, clock: ClockEstimator) -> WheelSample:
        host_us, error_us = clock.device_to_host(self._t_us)
        return WheelSample(
            boot_id=state.boot_id,
            t_us=self._t_us,
            left_ticks=state.left_ticks,
            right_ticks=state.right_ticks,
            left_mps=state.left_mps,
            right_mps=state.right_mps,
            left_duty=state.left_duty_q15 / DUTY_SCALE,
            right_duty=state.right_duty_q15 / DUTY_SCALE,
            command_seq=state.command_seq,
            state=_supervisor_state(state.supervisor),
            faults=_fault(state.faults),
            overruns=state.overruns,
            battery_v=state.battery_mv / 1000 if state.battery_mv else None,
            stamp=host_us / 1e6,
            stamp_error_s=error_us / 1e6,
        )
