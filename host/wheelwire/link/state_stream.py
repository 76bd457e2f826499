"""State frames into samples: none twice, in order, on the host's clock as well. Sans-IO."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import WheelState

from ..samples import WheelSample, tick_difference
from .clock import ClockEstimator, Conversion

DUTY_SCALE = 32767
UNWRAP_US = 60_000_000
"""Frames closer to each other than this need no estimate of the clock: 32 bits wrap in 71 min."""

# By a dictionary, in a seventh of the time: this is done for each state frame.
_supervisor_state = cache(SupervisorState)
_fault = cache(Fault)


class Measurement:
    """A state frame, which becomes a sample when somebody asks for it.

    Most are replaced by the next one before anybody does: making the sample, above all its stamp,
    costs more than all that is done with the others.

    Attributes:
        state: The frame.
        t_us: The device's clock at the latch, 64 bits. [us]
        arrived_us: The host's clock at the arrival. [us]
        supervisor: The supervisor's state.
        faults: Latched faults.
    """

    __slots__ = ("_clock", "arrived_us", "faults", "state", "supervisor", "t_us")

    def __init__(self, state: WheelState, t_us: int, clock: Conversion, arrived_us: int) -> None:
        """`clock` is the estimate at the arrival.

        Raises:
            ValueError: A code in the frame means nothing.
        """
        self.state = state
        self.t_us = t_us
        self.arrived_us = arrived_us
        self.supervisor = _supervisor_state(state.supervisor)
        self.faults = _fault(state.faults)
        self._clock = clock

    def sample(self) -> WheelSample:
        """The sample, with the stamp by the estimate at the arrival."""
        state = self.state
        host_us, error_us = self._clock.device_to_host(self.t_us)
        return WheelSample(
            boot_id=state.boot_id,
            t_us=self.t_us,
            left_ticks=state.left_ticks,
            right_ticks=state.right_ticks,
            left_mps=state.left_mps,
            right_mps=state.right_mps,
            left_duty=state.left_duty_q15 / DUTY_SCALE,
            right_duty=state.right_duty_q15 / DUTY_SCALE,
            command_seq=state.command_seq,
            state=self.supervisor,
            faults=self.faults,
            overruns=state.overruns,
            battery_v=state.battery_mv / 1000 if state.battery_mv else None,
            stamp=host_us / 1e6,
            stamp_error_s=error_us / 1e6,
        )


class StateStream:
    """The state frames of a link across its sessions: which are new, and when they were latched."""

    def __init__(self) -> None:
        self.stale = 0
        """Frames that were repeated, or older than the newest."""
        self.new = 0
        """Frames that were new."""
        self._boot_id: int | None = None
        self._t_us = 0
        self._arrived_us = 0

    def snapshot(self) -> tuple[int | None, int, int]:
        """What `resume` takes: the newest frame's boot, its latch and its arrival."""
        return self._boot_id, self._t_us, self._arrived_us

    def resume(self, boot_id: int | None, t_us: int, arrived_us: int) -> None:
        """Go on behind the frame of a snapshot."""
        self._boot_id, self._t_us, self._arrived_us = boot_id, t_us, arrived_us

    def newest(
        self, states: Iterable[WheelState], clock: ClockEstimator, now_us: int
    ) -> Measurement | None:
        """The newest of the state frames that came at `now_us`; None if none is new.

        The others are passed over: nobody could tell them from the newest in time.

        Raises:
            ValueError: A code in it means nothing.
        """
        newest = None
        for state in states:
            boot_id, former_us = state.boot_id, self._t_us
            # From the frame before, for nearly every frame; the estimate is for the first one, and
            # for one that comes after a pause in which 32 bits may have wrapped.
            if boot_id == self._boot_id and now_us < self._arrived_us + UNWRAP_US:
                t_us = former_us + tick_difference(state.t_us, former_us)
            else:
                t_us = clock.unwrap(state.t_us, now_us)
            # The same latch time: a frame that the line has doubled.
            if boot_id == self._boot_id and t_us <= former_us:
                self.stale += 1
            else:
                self._boot_id, self._t_us, self._arrived_us = boot_id, t_us, now_us
                self.new += 1
                newest = state
        if newest is None:
            return None
        # The estimate of this moment: later exchanges must not move a sample that is made later.
        return Measurement(newest, self._t_us, clock.conversion, now_us)
