"""State frames into samples: none twice, in order, on the host's clock as well. Sans-IO."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import WheelState

from ..samples import WheelSample
from .clock import ClockEstimator, Conversion
from .device_time import DeviceTime

DUTY_SCALE = 32767

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
        self._time = DeviceTime()

    def snapshot(self) -> tuple[int | None, int, int]:
        """What `resume` takes: the newest frame's boot, and its latch by both clocks."""
        return self._boot_id, *self._time.snapshot()

    def resume(self, boot_id: int | None, t_us: int, host_us: int) -> None:
        """Go on behind the frame of a snapshot."""
        self._boot_id = boot_id
        self._time.resume(t_us, host_us)

    def newest(
        self, states: Iterable[WheelState], clock: ClockEstimator, now_us: int
    ) -> Measurement | None:
        """The newest of the state frames that came at `now_us`; None if none is new.

        The others are passed over: nobody could tell them from the newest in time.

        Raises:
            ValueError: A code in it means nothing.
        """
        newest, time = None, self._time
        for state in states:
            boot_id = state.boot_id
            if boot_id != self._boot_id:
                time = DeviceTime()
            t_us = time.unwrapped(state.t_us, clock, now_us)
            # The same latch time: a frame that the line has doubled.
            if time is self._time and t_us <= time.t_us:
                self.stale += 1
            else:
                time.follow(t_us, clock, now_us)
                self._boot_id, self._time = boot_id, time
                self.new += 1
                newest = state
        if newest is None:
            return None
        # The estimate of this moment: later exchanges must not move a sample that is made later.
        return Measurement(newest, time.t_us, clock.conversion, now_us)
