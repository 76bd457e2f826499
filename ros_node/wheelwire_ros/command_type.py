"""Decides which message type is taken on cmd_vel. Pure: the time is an argument."""

from __future__ import annotations

import math
from collections.abc import Set

from .commands import AUTO, COMMAND_TYPES

PLAIN, STAMPED = COMMAND_TYPES
TURN_S = 1.0
"""While publishers of both types are there and none has sent anything, each type gets this long."""


class CommandType:
    """The type of cmd_vel.

    The one that the parameter names. With `auto` it is open at first: Twist, until a publisher of
    TwistStamped is there. The first message decides, not the first publisher, which may be a
    joystick that nobody touches. Once the last publisher of the decided type is gone it is open
    again.

    Args:
        wanted: `Twist`, `TwistStamped` or `auto`.
    """

    def __init__(self, wanted: str) -> None:
        self._is_fixed = wanted != AUTO
        self.name = wanted if self._is_fixed else PLAIN
        """The type to subscribe to now."""
        self.is_decided = self._is_fixed
        """Whether it stays, whatever else is published."""
        self._turn_ends_s = -math.inf

    def decide(self) -> bool:
        """A message of the present type has come; whether it decided the type."""
        decides = not self.is_decided
        self.is_decided = True
        return decides

    def look(self, published: Set[str], now_s: float) -> bool:
        """Follow the publishers that are there now; whether `name` has changed.

        Args:
            published: The types that they publish, of those that can be taken.
            now_s: On a monotonic clock.
        """
        if self._is_fixed or (self.is_decided and self.name in published):
            return False
        self.is_decided = False
        other = STAMPED if self.name == PLAIN else PLAIN
        if other not in published or (self.name in published and now_s < self._turn_ends_s):
            return False
        self.name = other
        self._turn_ends_s = now_s + TURN_S
        return True
