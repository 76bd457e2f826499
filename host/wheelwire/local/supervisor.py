"""The safety supervisor: the firmware's transition table, held to it by test."""

from __future__ import annotations

from wheelwire_protocol.codes import RefusalCode, SupervisorEvent, SupervisorState

_BOOT = SupervisorState.BOOT
_IDLE = SupervisorState.IDLE
_DRIVING = SupervisorState.DRIVING
_TIMED_OUT = SupervisorState.TIMED_OUT
_ESTOPPED = SupervisorState.ESTOPPED
_FAULT = SupervisorState.FAULT
_Event = SupervisorEvent

_WHILE_STOPPED = {_Event.ESTOP: _ESTOPPED, _Event.FAULT: _FAULT}
_WHILE_READY = {**_WHILE_STOPPED, _Event.SETPOINT: _DRIVING}
_END_OF_COMMAND = {_Event.STOP: _IDLE, _Event.SESSION: _IDLE}

TRANSITIONS: dict[SupervisorState, dict[SupervisorEvent, SupervisorState]] = {
    _BOOT: {**_WHILE_STOPPED, _Event.STARTED: _IDLE},
    _IDLE: _WHILE_READY,
    _DRIVING: {**_WHILE_READY, **_END_OF_COMMAND, _Event.DEADLINE: _TIMED_OUT},
    _TIMED_OUT: {**_WHILE_READY, **_END_OF_COMMAND},
    _ESTOPPED: {_Event.CLEAR_ESTOP: _IDLE},
    _FAULT: {_Event.CLEAR_FAULT: _IDLE, _Event.ESTOP: _ESTOPPED},
}
"""An event that a state does not list changes nothing. Clearing is kept away by a guard outside
the table while the cause lasts."""

SETPOINT_REFUSALS = {
    _BOOT: RefusalCode.BOOTING,
    _ESTOPPED: RefusalCode.ESTOPPED,
    _FAULT: RefusalCode.FAULT,
}


class Supervisor:
    """Decides whether the outputs may drive."""

    def __init__(self) -> None:
        self.state = _BOOT

    @property
    def may_drive(self) -> bool:
        """Only while a setpoint is obeyed."""
        return self.state is _DRIVING

    def apply(self, event: SupervisorEvent) -> bool:
        """Returns whether the state changed."""
        after = TRANSITIONS[self.state].get(event, self.state)
        changed = after is not self.state
        self.state = after
        return changed
