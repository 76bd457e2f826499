"""When the device was last heard: when to ping it, and when it counts as silent. Sans-IO."""

from __future__ import annotations

SILENCE_US = 2_000_000
"""No pong and no state frame for this long: the session is over, say hello again."""
QUIET_US = 100_000
"""Nothing was received for this long: ping, because a device that was reset sends nothing."""
IDLE_QUIET_US = 200_000
"""As `QUIET_US`, for a device that streams nothing: an idle link costs only these pings."""
STREAM_US = 500_000
"""A device is not streaming if no state came for this long while other messages did."""
QUIET_PERIOD_US = 25_000
"""Between pings until something is received."""


class Liveness:
    """When the device of a session that began at `now_us` was last heard.

    Attributes:
        heard_us: When anything of this session last came.
        state_us: When the last state frame came.
    """

    __slots__ = ("heard_us", "state_us")

    def __init__(self, now_us: int) -> None:
        self.heard_us = self.state_us = now_us

    @property
    def silent_us(self) -> int:
        """From when on the device counts as silent, if nothing more comes."""
        return self.heard_us + SILENCE_US

    def ping_due_us(self, pinged_us: int) -> int:
        """When to ping, if nothing comes until then; `pinged_us`: when it was pinged last."""
        # A device that streams is expected to be heard, so its silence is looked into sooner.
        streams = self.heard_us < self.state_us + STREAM_US
        quiet_us = self.heard_us + (QUIET_US if streams else IDLE_QUIET_US)
        # An answer may be on its way: a busy device must not be flooded.
        return max(quiet_us, pinged_us + QUIET_PERIOD_US)
