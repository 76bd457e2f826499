"""The device's clock in 64 bits, of messages that carry its lower 32. Sans-IO."""

from __future__ import annotations

from ..samples import tick_difference
from .clock import ClockEstimator

UNWRAP_US = 60_000_000
"""Messages closer to each other than this need no estimate of the clock: 32 bits wrap in 71 min."""


class DeviceTime:
    """Unwraps the times of a stream of messages, mostly from the newest one before.

    The age of that one counts, not its arrival: while a program was stopped, messages may have
    waited for it for an hour, and a fresh one follows them at once.

    Attributes:
        t_us: The newest message's time, 64 bits. [us]
        host_us: The host's clock at that time, as far as it is known. [us]
    """

    __slots__ = ("_clock", "host_us", "t_us")

    def __init__(self) -> None:
        self.t_us = self.host_us = 0
        self._clock: ClockEstimator | None = None

    def unwrapped(self, t_us: int, clock: ClockEstimator, now_us: int) -> int:
        """The time `t_us` of a message that came at the host's `now_us`."""
        # Another clock is another session's: the computer may have slept before it, and its own
        # clock with it.
        if clock is self._clock and now_us < self.host_us + UNWRAP_US:
            return self.t_us + tick_difference(t_us, self.t_us)
        return clock.unwrap(t_us, now_us)

    def follow(self, t_us: int, clock: ClockEstimator, now_us: int) -> None:
        """Take this as the time of the newest message, which came at `now_us`."""
        if clock is self._clock and now_us < self.host_us + UNWRAP_US:
            host_us = self.host_us + t_us - self.t_us
        else:
            host_us = round(clock.conversion.device_to_host(t_us)[0])
            self._clock = clock
        self.t_us, self.host_us = t_us, min(host_us, now_us)

    def snapshot(self) -> tuple[int, int]:
        """What `resume` takes."""
        return self.t_us, self.host_us

    def resume(self, t_us: int, host_us: int) -> None:
        """Go on behind the message of a snapshot."""
        self.t_us, self.host_us = t_us, host_us
