"""The trial of parameters that an application holds: renewed while its session lasts. Sans-IO."""

from __future__ import annotations

import enum

from wheelwire_protocol.codes import RefusalCode, TrialAction
from wheelwire_protocol.types import ParameterTrial

from ..errors import DeviceRefused

SHORTEST_TRIAL_S, LONGEST_TRIAL_S = 0.2, 60.0
"""The time-outs that a device takes."""
RENEWALS = 4
"""In each time-out: some may be lost."""


class _State(enum.Enum):
    NONE = enum.auto()
    RUNNING = enum.auto()
    ENDING = enum.auto()
    """The device was asked to keep or revert it."""
    LOST = enum.auto()
    """The device has reverted it, and the application has not left it yet."""


class HeldTrial:
    """What a session knows of its application's trial. At most one is held."""

    def __init__(self) -> None:
        self._state = _State.NONE
        self._timeout_s = 0.0
        self._due_us = 0
        self._renewing = False

    @property
    def due_us(self) -> int | None:
        """When to renew it next."""
        running = self._state is _State.RUNNING and not self._renewing
        return self._due_us if running else None

    def check(self, subject: str) -> None:
        """Raise `DeviceRefused` for what relies on values that are no longer in force."""
        if self._state is _State.LOST:
            raise DeviceRefused(RefusalCode.NO_TRIAL, subject)

    def on_request(self, request: ParameterTrial) -> None:
        """The application asks for it.

        Raises:
            DeviceRefused: Another one is held.
        """
        if request.action == TrialAction.BEGIN and self._state is not _State.NONE:
            raise DeviceRefused(RefusalCode.ON_TRIAL, "another trial of parameters")
        if request.action != TrialAction.BEGIN and self._state is _State.RUNNING:
            self._state = _State.ENDING  # a renewal after that would find none

    def on_done(self, request: ParameterTrial, now_us: int) -> None:
        """The device has done what it was asked for."""
        if request.action == TrialAction.BEGIN:
            self._state = _State.RUNNING
            self._timeout_s = request.timeout_s
            self._renewing = False
            self._wait(now_us)
        elif request.action != TrialAction.RENEW:
            self.release()

    def renewal(self, now_us: int) -> ParameterTrial | None:
        """The request to send now, if any. `renewed` is to be called when it is over."""
        due_us = self.due_us  # once: another thread may release it at any moment
        if due_us is None or now_us < due_us:
            return None
        # None beside it until it is over: the request is repeated as it is.
        self._renewing = True
        self._wait(now_us)
        return ParameterTrial(0, 0, TrialAction.RENEW, self._timeout_s)

    def renewed(self) -> None:
        """The renewal was answered, or given up."""
        self._renewing = False

    def lose(self) -> None:
        """The session is over, and the trial with it."""
        if self._state is not _State.NONE:
            self._state = _State.LOST

    def release(self) -> None:
        """The application has left it; from any thread."""
        self._state = _State.NONE

    def _wait(self, now_us: int) -> None:
        self._due_us = now_us + round(self._timeout_s * 1e6 / RENEWALS)
