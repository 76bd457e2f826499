"""What host and device say to each other within a session. Sans-IO."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    ClearEstop,
    ClearFault,
    Event,
    ParameterEntry,
    ParameterValue,
    Pong,
    Refuse,
    WheelState,
)

from .errors import InvalidCommand, WheelwireError
from .requests import Answer, RequestQueue
from .sampler import Sampler
from .samples import WheelSample
from .setpoints import SETPOINT_IDS, Setpoint, SetpointSender
from .statistics import Tally
from .synchroniser import Synchroniser

QUIET_US = 100_000
"""Nothing was heard for this long: ping, for a device that was reset says nothing by itself."""
IDLE_QUIET_US = 200_000
"""The same of a device that streams nothing: these pings are all that an idle link costs."""
STREAM_US = 500_000
"""It streams nothing when no state came for this long, though it was heard."""
QUIET_PERIOD_US = 25_000
"""Between pings until something is heard."""
ROUND_TRIPS = 1024

_CLEARS = (message_id(ClearEstop), message_id(ClearFault))


class Conversation:
    """The requests, setpoints, pings and samples of one session after the other.

    Args:
        send: Takes a message for the line.
        tally: Counts what is refused, and what it must not believe.
    """

    def __init__(self, send: Callable[[AnyMessage], None], tally: Tally) -> None:
        self.values: dict[int, float] = {}
        """Parameter id -> the newest value that the device reported in this session."""
        self.round_trips_us: list[int] = []
        """The last `ROUND_TRIPS`, in no order: a list, which other threads can copy in one step."""
        self.requests = RequestQueue(send)
        self.setpoints = SetpointSender(send)
        self.sampler = Sampler()
        self.synchroniser = Synchroniser(0, send, 0)
        self._send = send
        self._tally = tally
        self._session_id = 0
        self._state_us = 0
        self._oldest_round_trip = 0

    def begin(self, session_id: int, now_us: int) -> None:
        """A session was opened."""
        self._session_id = session_id
        self._state_us = now_us
        self.values.clear()
        self.requests.begin_session()
        self.setpoints.begin_session()
        self.synchroniser = Synchroniser(session_id, self._send, now_us)
        self.synchroniser.ping(now_us)

    def end(self, error: WheelwireError) -> None:
        """The session ended: every open request fails with `error`."""
        self.setpoints.clear()
        self.requests.abort(error)

    def next_deadline_us(self, heard_us: int) -> int:
        """When `advance` has something to do; the device was last heard at `heard_us`."""
        others = self.requests.next_deadline_us, self.setpoints.repeat_due_us
        deadlines = [deadline for deadline in others if deadline is not None]
        return min([self._ping_due_us(heard_us), *deadlines])

    def awaits_answer(self, now_us: int) -> bool:
        """Whether a request or a ping is under way."""
        return self.requests.next_deadline_us is not None or self.synchroniser.awaits_pong(now_us)

    def advance(self, heard_us: int, now_us: int) -> None:
        """Repeat what is due, and ping."""
        self.requests.advance(now_us)
        self.setpoints.advance(now_us)
        if now_us >= self._ping_due_us(heard_us):
            self.synchroniser.ping(now_us)

    def drive(self, setpoint: Setpoint, expiry_us: int, now_us: int) -> None:
        """Send a setpoint that is void from the host's `expiry_us` on, if not a little earlier.

        The two clocks are known to each other with an error: its bound is taken off the expiry,
        or the setpoint could live longer than it was given.

        Raises:
            InvalidCommand: It would expire within that bound.
            DeviceRefused: The last setpoint was refused, or an e-stop or a fault is latched.
        """
        self.setpoints.check()
        clock = self.synchroniser.clock
        bound_us = math.ceil(clock.error_us(expiry_us))
        sure_us = expiry_us - bound_us
        if sure_us <= now_us:
            raise InvalidCommand(
                f"{(expiry_us - now_us) / 1e3:g} ms are left of the setpoint's ttl, and the "
                f"device's clock is known to {bound_us / 1e3:g} ms: give it a longer ttl"
            )
        expiry = clock.host_to_device(expiry_us) - bound_us
        dated = setpoint._replace(session_id=self._session_id, expiry_us=expiry)
        self.setpoints.submit(dated, sure_us, now_us)

    # --- what the device says ------------------------------------------------------------------

    def on_pong(self, pong: Pong, now_us: int) -> None:
        """An answer to a ping."""
        exchange = self.synchroniser.on_pong(pong, now_us)
        if exchange is None:
            self._tally.foreign += 1
        else:
            self._note_round_trip(exchange.round_trip_us)

    def on_states(self, states: Iterable[WheelState], now_us: int) -> WheelSample | None:
        """State frames in a row; returns the sample of the newest, if it is a new one."""
        self._state_us = now_us
        try:
            sample = self.sampler.sample(states, self.synchroniser.clock, now_us)
        except ValueError:
            self._tally.invalid += 1
            return None
        if sample is not None:
            self.setpoints.supervisor = sample.state
            self.setpoints.faults = sample.faults
            self.setpoints.on_obeyed(sample.command_seq)
        return sample

    def on_event(self, event: Event) -> None:
        """A transition of the supervisor."""
        try:
            self.setpoints.supervisor = SupervisorState(event.after)
            self.setpoints.faults = Fault(event.faults)
        except ValueError:
            self._tally.invalid += 1

    def on_refuse(self, refuse: Refuse, now_us: int) -> None:
        """The device refuses a setpoint or a request."""
        if refuse.message_id in SETPOINT_IDS:
            self.setpoints.on_refused(refuse)
        elif not self.requests.on_refuse(refuse, now_us):
            self._tally.foreign += 1

    def on_answer(self, answer: Answer, now_us: int) -> None:
        """An answer to a request."""
        if not self.requests.on_answer(answer, now_us):
            self._tally.foreign += 1
        elif isinstance(answer, (ParameterValue, ParameterEntry)):
            self.values[answer.parameter] = answer.value
        elif isinstance(answer, Ack) and answer.message_id in _CLEARS:
            self.setpoints.clear()

    def _note_round_trip(self, round_trip_us: int) -> None:
        if len(self.round_trips_us) < ROUND_TRIPS:
            self.round_trips_us.append(round_trip_us)
        else:
            self.round_trips_us[self._oldest_round_trip] = round_trip_us
            self._oldest_round_trip = (self._oldest_round_trip + 1) % ROUND_TRIPS

    # --- sending -------------------------------------------------------------------------------

    def _ping_due_us(self, heard_us: int) -> int:
        streams = heard_us < self._state_us + STREAM_US
        quiet_us = heard_us + (QUIET_US if streams else IDLE_QUIET_US)
        earliest_us = self.synchroniser.sent_us + QUIET_PERIOD_US
        return min(self.synchroniser.due_us, max(quiet_us, earliest_us))
