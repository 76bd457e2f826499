"""One host's conversation with one device, from hello to samples.

Sans-IO: bytes and times in; bytes, samples and the next deadline out, so that it runs in virtual
time as well. All times are microseconds of one monotonic host clock.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.types import Estop, SetDuty, SetWheelVelocity, Stop

from .conversation import Conversation
from .device import DeviceInfo
from .errors import LinkLost, WheelwireError
from .greeting import Greeting
from .lifecycle import Lifecycle, Phase
from .message_stream import MessageStream
from .preparation import Preparation
from .reception import Reception
from .requests import Done, RequestMessage
from .sampler import DUTY_SCALE
from .samples import WheelSample
from .setpoints import Setpoint
from .statistics import LinkStatistics, Tally, quantile

__all__ = ["Phase", "Session"]


class Session:
    """The host's side of the link.

    Args:
        nonce: Draws 32 random bits, anew for each session.
        stream_rate_hz: Rate of the state frames; None leaves it as the device has it.
        watched: Ids of parameters whose values are read whenever a session opens.
        any_board: Whether to go on with another board than that of the first session.
    """

    def __init__(
        self,
        nonce: Callable[[], int],
        stream_rate_hz: int | None = None,
        watched: Sequence[int] = (),
        *,
        any_board: bool = False,
    ) -> None:
        self._tally = Tally()
        self._stream = MessageStream()
        self._conversation = Conversation(self._stream.send, self._tally)
        greeting = Greeting(self._stream.send, nonce)
        self._lifecycle = Lifecycle(
            greeting, self._tally, any_board, self._begin, self._conversation.end
        )
        self._preparation = Preparation(
            self._lifecycle, self._conversation, watched, stream_rate_hz
        )
        self._reception = Reception(self._stream, self._lifecycle, self._conversation, self._tally)

    # --- what there is -------------------------------------------------------------------------

    @property
    def phase(self) -> Phase:
        """How far the conversation has come."""
        return self._lifecycle.phase

    @property
    def error(self) -> WheelwireError:
        """Why the session is not open; without meaning while it is."""
        return self._lifecycle.error

    @property
    def device(self) -> DeviceInfo | None:
        """The device of the newest session."""
        return self._lifecycle.device

    @property
    def count(self) -> int:
        """How many sessions there were."""
        return self._lifecycle.sessions

    @property
    def answers(self) -> int:
        """How often something understood a hello, whether it opened a session or not."""
        return self._lifecycle.answers

    @property
    def unanswered_since_us(self) -> int | None:
        """Since when hellos have gone unanswered; None while there is a session or no port."""
        return self._lifecycle.unanswered_since_us

    @property
    def frames_received(self) -> int:
        """Good frames of known messages, since the start."""
        return self._stream.counters.frames

    @property
    def bytes_received(self) -> int:
        """Since the start."""
        return self._stream.bytes_received

    @property
    def values(self) -> dict[int, float]:
        """Parameter id -> the newest value that the device reported in this session."""
        return self._conversation.values

    def statistics(self, now_us: int) -> LinkStatistics:
        """A snapshot of what was counted."""
        counters, talk = self._stream.counters, self._conversation
        clock, round_trips_us = talk.synchroniser.clock, talk.round_trips_us
        return LinkStatistics(
            frames_sent=self._stream.frames_sent,
            frames_received=counters.frames,
            frames_lost=counters.seq_lost,
            bad_crc=counters.bad_crc,
            bad_cobs=counters.bad_cobs,
            unknown_id=counters.unknown_id,
            wrong_length=counters.wrong_length,
            repeated=counters.repeated,
            stale_states=talk.sampler.stale,
            invalid=self._tally.invalid,
            foreign=self._tally.foreign,
            refused=self._tally.refused,
            requests_repeated=talk.requests.repeated,
            setpoints_repeated=talk.setpoints.repeated,
            sessions=self.count,
            device_resets=self._lifecycle.boots.resets,
            round_trip_p50_us=quantile(round_trips_us, 0.50),
            round_trip_p99_us=quantile(round_trips_us, 0.99),
            clock_error_us=clock.error_us(now_us) if clock.synchronised else float("nan"),
        )

    # --- the port ------------------------------------------------------------------------------

    def connect(self, now_us: int) -> None:
        """The port is open: say hello. Sequence numbers start anew."""
        self._stream.restart()
        self._lifecycle.greet(LinkLost("the device has not answered yet"), now_us)

    def renew(self, error: WheelwireError, now_us: int) -> None:
        """What the session knew has become worthless: begin another one, if one was begun."""
        if self._lifecycle.in_session:
            self._lifecycle.greet(error, now_us)

    def disconnect(self, error: WheelwireError) -> None:
        """The port is gone: every open request fails with `error`."""
        self._lifecycle.close(error)
        self._stream.discard_output()

    def receive(self, data: bytes, now_us: int) -> list[WheelSample]:
        """Take what has arrived. Never raises on any bytes.

        Returns:
            New samples, of state frames in a row the newest.
        """
        samples = self._reception.take(data, now_us)
        self._preparation.advance(now_us)
        return samples

    def advance(self, now_us: int) -> None:
        """Do what is due."""
        self._lifecycle.advance(now_us)
        if self._lifecycle.in_session:
            self._conversation.advance(self._lifecycle.heard_us, now_us)
            self._preparation.advance(now_us)

    @property
    def next_deadline_us(self) -> int | None:
        """When `advance` has something to do; None while there is no port."""
        deadline_us = self._lifecycle.next_deadline_us
        if deadline_us is None or not self._lifecycle.in_session:
            return deadline_us
        return min(deadline_us, self._conversation.next_deadline_us(self._lifecycle.heard_us))

    def awaits_answer(self, now_us: int) -> bool:
        """Whether something may come that is to be handled at once."""
        return self.phase is not Phase.OPEN or self._conversation.awaits_answer(now_us)

    def take_output(self) -> bytes:
        """The bytes to send, once."""
        return self._stream.take_output()

    # --- what the application asks for ---------------------------------------------------------

    def check_connected(self) -> None:
        """Raise why there is no port, if there is none."""
        if self.phase is Phase.CLOSED:
            raise self.error.with_traceback(None)

    def check_open(self) -> None:
        """Raise why the session is not open, if it is not."""
        if self.phase is not Phase.OPEN:
            raise self.error.with_traceback(None)  # it may be raised for hours: let none pile up

    def drive_velocity(
        self, left_mps: float, right_mps: float, expiry_us: int, now_us: int
    ) -> None:
        """Send a velocity setpoint that is void from the host's `expiry_us` on.

        Raises:
            InvalidCommand: It would expire within the error bound of the device's clock.
            LinkLost: The session is not open.
            DeviceRefused: The last setpoint was refused, or an e-stop or a fault is latched.
        """
        self._drive(SetWheelVelocity(0, 0, 0, left_mps, right_mps), expiry_us, now_us)

    def drive_duty(self, left: float, right: float, expiry_us: int, now_us: int) -> None:
        """Send a duty setpoint, -1..1; otherwise as `drive_velocity`."""
        duties = round(left * DUTY_SCALE), round(right * DUTY_SCALE)
        self._drive(SetDuty(0, 0, 0, *duties), expiry_us, now_us)

    def stop(self, mode: StopMode, done: Done, now_us: int) -> None:
        """Void the setpoint and stop. Without a session the stop is sent unacknowledged."""
        last_seq = self._conversation.setpoints.last_seq
        self._stop(Stop(self._lifecycle.session_id, 0, last_seq, mode), done, now_us)

    def estop(self, done: Done, now_us: int) -> None:
        """Stop and latch. Without a session it is sent unacknowledged."""
        self._stop(Estop(self._lifecycle.session_id, 0), done, now_us)

    def request(self, message: RequestMessage, done: Done, now_us: int) -> None:
        """Send a request; its session_id and request_id are filled in.

        Raises:
            LinkLost: The session is not open.
        """
        self.check_open()
        ours = message._replace(session_id=self._lifecycle.session_id)
        self._conversation.requests.submit(ours, done, now_us)

    def _begin(self, now_us: int) -> None:
        self._stream.restart_sequence()
        self._conversation.begin(self._lifecycle.session_id, now_us)
        self._preparation.begin(now_us)

    def _drive(self, setpoint: Setpoint, expiry_us: int, now_us: int) -> None:
        self.check_open()
        self._conversation.drive(setpoint, expiry_us, now_us)

    def _stop(self, message: Stop | Estop, done: Done, now_us: int) -> None:
        self._conversation.setpoints.clear()
        if self.phase is Phase.OPEN:
            self._conversation.requests.submit(message, done, now_us)
            return
        if self.phase is not Phase.CLOSED:
            self._stream.send(message)
        done(self.error)
