"""Setpoints: whether one may be sent, its number, and its one repeat; never renewed. Sans-IO."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import Fault, RefusalCode, SupervisorState
from wheelwire_protocol.types import AnyMessage, Refuse, SetDuty, SetWheelVelocity

from .errors import NO_FAULT, DeviceRefused

REPEAT_AFTER_US = 20_000
"""Time for a state frame to show that the setpoint arrived, at 100 frames a second."""

Setpoint: TypeAlias = SetWheelVelocity | SetDuty

SETPOINT_IDS = frozenset({message_id(SetWheelVelocity), message_id(SetDuty)})

_LATCHED = {
    SupervisorState.ESTOPPED: RefusalCode.ESTOPPED,
    SupervisorState.FAULT: RefusalCode.FAULT,
}


@dataclass
class SetpointSender:
    """The setpoints of a link. The latest wins.

    Args:
        send: Takes a message for the line.
    """

    send: Callable[[AnyMessage], None]
    last_seq: int = 0
    """The newest command_seq used in this session; 0: none yet."""
    repeated: int = 0
    repeat_due_us: int | None = None
    supervisor: SupervisorState | None = None
    """The newest known; None when it is about to change, or no session is open."""
    faults: Fault = NO_FAULT
    """The newest known to be latched."""
    _refusal: int | None = None
    _unseen: Setpoint | None = None
    _expiry_host_us: int = 0

    def begin_session(self) -> None:
        """Forget all of the former session."""
        self.clear()
        self.last_seq = 0

    def clear(self) -> None:
        """What was refused or latched is past, and what was sent is void."""
        self._forget()
        self._refusal = None
        self.supervisor = None
        self.faults = NO_FAULT

    def check(self) -> None:
        """Find out before sending that the device will not drive.

        Raises:
            DeviceRefused: The last setpoint was refused (told once), or the device is latched.
        """
        refusal, self._refusal = self._refusal, None
        if refusal is None and self.supervisor is not None:
            refusal = _LATCHED.get(self.supervisor)
        if refusal is not None:
            faults = self.faults if refusal == RefusalCode.FAULT else NO_FAULT
            raise DeviceRefused(refusal, "the setpoint", faults)

    def submit(self, setpoint: Setpoint, expiry_host_us: int, now_us: int) -> None:
        """Number and send a setpoint; its expiry on the device's clock is already in it."""
        self.last_seq += 1
        self._unseen = setpoint._replace(command_seq=self.last_seq)
        self._expiry_host_us = expiry_host_us
        self.repeat_due_us = now_us + REPEAT_AFTER_US
        self.send(self._unseen)

    def advance(self, now_us: int) -> None:
        """Send an unseen setpoint once more, with its own number and expiry, while it is valid."""
        if self.repeat_due_us is None or now_us < self.repeat_due_us:
            return
        if self._unseen is not None and now_us < self._expiry_host_us:
            self.repeated += 1
            self.send(self._unseen)
        self._forget()

    def on_obeyed(self, command_seq: int) -> None:
        """The device says which setpoint it obeys."""
        if command_seq == self.last_seq:
            self._forget()

    def on_refused(self, refuse: Refuse) -> None:
        """The device refused one."""
        self._refusal = refuse.code
        if refuse.reference == self.last_seq:
            self._forget()

    def _forget(self) -> None:
        self._unseen = None
        self.repeat_due_us = None
