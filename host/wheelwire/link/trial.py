"""The trial of parameters that an application holds: renewed while its session lasts. Sans-IO."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from wheelwire_protocol.codes import RefusalCode, TrialAction
from wheelwire_protocol.types import ParameterTrial

from ..errors import DeviceRefused

SHORTEST_TRIAL_S, LONGEST_TRIAL_S = 0.2, 60.0
"""The time-outs that a device takes."""
RENEWALS = 4
"""In each time-out: some may be lost."""


class _State(enum.Enum):
    RUNNING = enum.auto()
    ENDING = enum.auto()
    """The device was asked to keep or revert it."""
    LOST = enum.auto()
    """The device has reverted it, and the application has not left it yet."""


@dataclass(slots=True)
class _Trial:
    timeout_s: float
    due_us: int
    state: _State = _State.RUNNING
    renewing: bool = False

    def wait(self, now_us: int) -> None:
        self.due_us = now_us + round(self.timeout_s * 1e6 / RENEWALS)


class HeldTrial:
    """What a session knows of its application's trial. At most one is held.

    Any thread may release it. That needs no lock: each method takes the trial that is held once,
    and what it notes of a trial that was released meanwhile is recorded nowhere else.
    """

    def __init__(self) -> None:
        self._held: _Trial | None = None

    @property
    def due_us(self) -> int | None:
        """When to renew it next."""
        held = self._held
        if held is None or held.state is not _State.RUNNING or held.renewing:
            return None
        return held.due_us

    def check(self, subject: str) -> None:
        """Raise `DeviceRefused` for what relies on values that are no longer active."""
        held = self._held
        if held is not None and held.state is _State.LOST:
            raise DeviceRefused(RefusalCode.NO_TRIAL, subject)

    def on_request(self, request: ParameterTrial) -> None:
        """The application asks for it.

        Raises:
            DeviceRefused: Another one is held.
        """
        held = self._held
        if held is None:
            return
        if request.action == TrialAction.BEGIN:
            raise DeviceRefused(RefusalCode.ON_TRIAL, "another trial of parameters")
        if held.state is _State.RUNNING:
            held.state = _State.ENDING  # a renewal after that would find none

    def on_done(self, request: ParameterTrial, now_us: int) -> None:
        """The device has done what it was asked for."""
        if request.action == TrialAction.BEGIN:
            begun = _Trial(request.timeout_s, now_us)
            begun.wait(now_us)
            self._held = begun
        elif request.action != TrialAction.RENEW:
            self.release()

    def renewal(self, now_us: int) -> ParameterTrial | None:
        """The request to send now, if any. `renewed` is to be called when it is over."""
        held, due_us = self._held, self.due_us
        if held is None or due_us is None or now_us < due_us:
            return None
        # None beside it until it is over: the request is repeated as it is.
        held.renewing = True
        held.wait(now_us)
        return ParameterTrial(0, 0, TrialAction.RENEW, held.timeout_s)

    def renewed(self) -> None:
        """The renewal was answered, or given up."""
        held = self._held
        if held is not None:
            held.renewing = False

    def lose(self) -> None:
        """The session is over, and the trial with it."""
        held = self._held
        if held is not None:
            held.state = _State.LOST

    def release(self) -> None:
        """The application has left it; from any thread."""
        self._held = None
