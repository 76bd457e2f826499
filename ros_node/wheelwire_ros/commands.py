"""Decides which velocity commands are obeyed, and for how long. Sends nothing itself."""

from __future__ import annotations

import enum
import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

COMMAND_TYPES = ("Twist", "TwistStamped")
"""What can be published on cmd_vel, of geometry_msgs."""
AUTO = "auto"
"""Instead of one of them: what the first message is of."""


class Ignored(enum.Enum):
    """Why a command was not obeyed."""

    INACTIVE = "the node is not active"
    ESTOPPED = "the e-stop is set"
    STALE = "it is older than cmd_vel_timeout"
    BEFORE_RECONNECT = "it is older than the connection to the robot"
    INVALID = "it is not a finite velocity"
    REFUSED = "the robot refused it"
    UNARMED = "an e-stop or a fault was cleared: waiting for a zero command, or for a pause"
    OUT_OF_REACH = "the robot cannot be reached"


class CommandIgnored(Exception):  # noqa: N818 - it says what happened to the command
    """A command was not obeyed and is dropped."""

    def __init__(self, reason: Ignored, detail: str = "") -> None:
        super().__init__(f"command ignored: {detail or reason.value}")
        self.reason = reason


@dataclass
class CommandGate:
    """Accepts or rejects commands by their age.

    Attributes:
        timeout_s: How long a command is valid from its stamp.
        connected_s: When the current session was ready, on the monotonic clock.
        obeyed: Number of commands sent to the robot.
        ignored: Number of commands that were not, by reason.
    """

    timeout_s: float
    connected_s: float = 0.0
    obeyed: int = 0
    ignored: Counter[Ignored] = field(default_factory=Counter)

    def check(self, born_s: float, now_s: float) -> None:
        """Raise `CommandIgnored` if a command given at `born_s` is too old."""
        age_s = now_s - born_s
        if age_s >= self.timeout_s:
            raise CommandIgnored(
                Ignored.STALE,
                f"it is {age_s:.3f} s old; are the computers' clocks synchronised?",
            )
        if born_s < self.connected_s:
            raise CommandIgnored(Ignored.BEFORE_RECONNECT)

    def count(self, ignored: CommandIgnored) -> None:
        """Count a command that was not obeyed."""
        self.ignored[ignored.reason] += 1


class LogPace:
    """Decides what is logged of something that happens again and again.

    Each key for itself: two that alternate at 50 Hz are still two lines in a period.

    Args:
        period_s: Between two lines of one key.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._due_s: dict[Any, float] = {}

    def is_due(self, key: Any, now_s: float) -> bool:
        """Whether to log it now."""
        if now_s < self._due_s.get(key, -math.inf):
            return False
        self._due_s[key] = now_s + self._period_s
        return True


def command_age_s(stamp_ns: int | None, now_ns: int, waited_ns: int, rate: float = 1.0) -> float:
    """A command's age in seconds: since its stamp, but at least since it was received.

    So a sender whose clock is ahead does not make its commands valid for longer.

    Args:
        stamp_ns: From the message's header; None or 0: use the time of reception.
        now_ns: The current time on the clock of the stamps.
        waited_ns: Time since it was received by this computer.
        rate: How fast that clock runs; a command lives in real time.
    """
    since_stamped_ns = (now_ns - stamp_ns) / rate if stamp_ns else 0
    # At least 0: the clock that measured the wait may have been set back meanwhile.
    return max(0, waited_ns, since_stamped_ns) / 1e9
