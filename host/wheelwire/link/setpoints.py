"""Setpoints: whether one may be sent, and its one repeat; never renewed. Sans-IO.

Any thread may send one while the port's thread receives, and nothing is locked: what both touch is
replaced in one assignment.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import RefusalCode, SupervisorState
from wheelwire_protocol.types import AnyMessage, Refuse, SetDuty, SetWheelVelocity

from ..errors import NO_FAULT, DeviceRefused

REPEAT_AFTER_US = 20_000
"""Time for a state frame to show that the setpoint arrived, at 100 frames a second."""

Setpoint: TypeAlias = SetWheelVelocity | SetDuty

SETPOINT_IDS = frozenset({message_id(SetWheelVelocity), message_id(SetDuty)})

_LATCHED = {
    SupervisorState.ESTOPPED: RefusalCode.ESTOPPED,
    SupervisorState.FAULT: RefusalCode.FAULT,
}


class _Unseen(NamedTuple):
    """Sent, and no state frame has shown yet that the device obeys it."""

    setpoint: Setpoint
    expiry_host_us: int
    repeat_due_us: int


class SetpointSender:
    """What is known of the setpoints of a link. The latest wins.

    Args:
        send: Takes a message for the line: the repeats.

    Attributes:
        repeated: How many were sent again.
        supervisor: The newest known; None when it is about to change, or no session is open.
        faults: The newest known to be latched.
    """

    def __init__(self, send: Callable[[AnyMessage], None]) -> None:
        self.repeated = 0
        self.supervisor: SupervisorState | None = None
        self.faults = NO_FAULT
        self._send = send
        self._refusal: int | None = None
        self._unseen: _Unseen | None = None

    @property
    def repeat_due_us(self) -> int | None:
        """When `advance` has something to do."""
        unseen = self._unseen
        return None if unseen is None else unseen.repeat_due_us

    def clear(self) -> None:
        """What was refused or latched is past, and what was sent is void."""
        self._unseen = None
        self._refusal = None
        self.supervisor = None
        self.faults = NO_FAULT

    def void(self) -> None:
        """What was sent is not to be sent again."""
        self._unseen = None

    def on_stop(self) -> None:
        """A stop goes out: what was sent before it, or refused, is past.

        What is latched stays known: the copy of an e-stop that its caller wrote may have latched
        the device already.
        """
        self._unseen = None
        self._refusal = None

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

    def note_sent(self, setpoint: Setpoint, expiry_host_us: int, now_us: int) -> None:
        """A setpoint goes out; its number and its expiry on the device's clock are in it."""
        self._unseen = _Unseen(setpoint, expiry_host_us, now_us + REPEAT_AFTER_US)

    def advance(self, now_us: int) -> None:
        """Send an unseen setpoint once more, with its own number and expiry, while it is valid."""
        unseen = self._unseen
        if unseen is None or now_us < unseen.repeat_due_us:
            return
        if now_us < unseen.expiry_host_us:
            self.repeated += 1
            self._send(unseen.setpoint)
        self._forget(unseen)

    def on_obeyed(self, command_seq: int) -> None:
        """The device says which setpoint it obeys."""
        unseen = self._unseen
        if unseen is not None and unseen.setpoint.command_seq == command_seq:
            self._forget(unseen)

    def on_refused(self, refuse: Refuse) -> None:
        """The device refused one."""
        self._refusal = refuse.code
        self.on_obeyed(refuse.reference)

    def _forget(self, unseen: _Unseen) -> None:
        # Another thread may have sent the next one meanwhile. In the instant between the two
        # lines that one's repeat can still be lost: it is not needed on a good line.
        if self._unseen is unseen:
            self._unseen = None
