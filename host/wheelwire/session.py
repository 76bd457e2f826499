"""One host's conversation with one device, from hello to samples.

Sans-IO: bytes and times in; bytes, samples and the next deadline out, so that it runs in virtual
time as well. All times are microseconds of one monotonic host clock.
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Callable, Sequence

from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import RefusalCode, StopMode, SupervisorState
from wheelwire_protocol.framing import Decoder, Encoder
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    ClearEstop,
    ClearFault,
    DeviceHello,
    Estop,
    Event,
    LinkCounters,
    ParameterEntry,
    ParameterGet,
    ParameterValue,
    Pong,
    Refuse,
    SetDuty,
    SetStreamRate,
    SetWheelVelocity,
    Stop,
    WheelState,
)

from .device import BootHistory, DeviceInfo
from .errors import LinkLost, WheelwireError
from .greeting import Greeting
from .requests import ID_MODULUS, Answer, Done, RequestMessage, RequestQueue
from .sampler import DUTY_SCALE, Sampler
from .samples import WheelSample
from .setpoints import SETPOINT_IDS, Setpoint, SetpointSender
from .statistics import LinkStatistics, quantile
from .synchroniser import Synchroniser

SILENCE_US = 2_000_000
"""No ping answered and no state frame for this long: the session is over, say hello again."""
QUIET_US = 100_000
"""Nothing was heard for this long: ping at once, for a device that was reset says nothing."""
RETRY_US = 1_000_000
"""Between attempts at a session that the device lets us open but not use."""
ROUND_TRIPS = 1024

_CLEARS = (message_id(ClearEstop), message_id(ClearFault))


class Phase(enum.Enum):
    """How far the conversation has come."""

    CLOSED = enum.auto()
    """No port."""
    GREETING = enum.auto()
    """Hello is repeated until answered."""
    SYNCHRONISING = enum.auto()
    """The clock is read."""
    PREPARING = enum.auto()
    """The stream rate and the watched parameters are settled."""
    OPEN = enum.auto()


_IN_SESSION = (Phase.SYNCHRONISING, Phase.PREPARING, Phase.OPEN)


class Session:
    """The host's side of the link.

    Args:
        nonce: Draws 32 random bits, anew for each session.
        stream_rate_hz: Rate of the state frames; None leaves it as the device has it.
        watched: Ids of parameters whose values are read whenever a session opens.
    """

    def __init__(
        self,
        nonce: Callable[[], int],
        stream_rate_hz: int | None = None,
        watched: Sequence[int] = (),
    ) -> None:
        self.phase = Phase.CLOSED
        self.error: WheelwireError = LinkLost("the port was not opened yet")
        """Why the session is not open; without meaning while it is."""
        self.device: DeviceInfo | None = None
        """The device of the newest session."""
        self.values: dict[int, float] = {}
        """Parameter id -> the newest value that the device reported in this session."""
        self.stream_rate_hz = stream_rate_hz
        self.bytes_received = 0
        self.answered = False
        """Something on the line understood a hello, whether it opened a session or not."""
        self._watched = tuple(watched)
        self._greeting = Greeting(self._send, nonce)
        self._session_id = 0
        self._boots = BootHistory()
        self._encoder = Encoder()
        self._decoder = Decoder()
        self._output = bytearray()
        self._heard_us = 0
        self._request_id = 0
        self._requests = RequestQueue(self._send, self._next_id)
        self._setpoints = SetpointSender(self._send)
        self._synchroniser = self._new_synchroniser(0)
        self._sampler = Sampler()
        self._samples: list[WheelSample] = []
        self._round_trips: deque[int] = deque(maxlen=ROUND_TRIPS)
        self._frames_sent = self._invalid = self._foreign = self._refused = 0
        self._sessions = 0
        self._handlers: dict[type[AnyMessage], Callable[..., None]] = {
            DeviceHello: self._on_hello,
            Pong: self._on_pong,
            WheelState: self._on_state,
            Event: self._on_event,
            Refuse: self._on_refuse,
            Ack: self._on_answer,
            ParameterValue: self._on_answer,
            ParameterEntry: self._on_answer,
            LinkCounters: self._on_answer,
        }

    # --- the port ------------------------------------------------------------------------------

    def connect(self, now_us: int) -> None:
        """The port is open: say hello. Sequence numbers start anew."""
        self._encoder = Encoder()
        counters, self._decoder = self._decoder.counters, Decoder()
        self._decoder.counters = counters
        self._output.clear()
        self._greet(LinkLost("the device has not answered yet"), now_us)

    def disconnect(self, error: WheelwireError) -> None:
        """The port is gone: every open request fails with `error`."""
        self._end(error)
        self._output.clear()

    def receive(self, data: bytes, now_us: int) -> list[WheelSample]:
        """Take what has arrived; returns the new samples in it. Never raises on any bytes."""
        self.bytes_received += len(data)
        for message in self._decoder.feed(data):
            handler = self._handlers.get(type(message))
            if handler is None:
                self._foreign += 1  # a message of the host's own kind: an echo
            else:
                handler(message, now_us)
        samples, self._samples = self._samples, []
        return samples

    def advance(self, now_us: int) -> None:
        """Do what is due."""
        if self.phase is Phase.CLOSED:
            return
        if self.phase is Phase.GREETING:
            self._greeting.advance(now_us)
            return
        if now_us >= self._heard_us + SILENCE_US:
            self._greet(LinkLost("the device fell silent; saying hello until it answers"), now_us)
            return
        self._requests.advance(now_us)
        self._setpoints.advance(now_us)
        if now_us >= self._ping_due_us:
            self._synchroniser.ping(now_us)
        self._prepare_when_ready(now_us)

    @property
    def _ping_due_us(self) -> int:
        quiet_since_us = max(self._heard_us, self._synchroniser.sent_us)
        return min(self._synchroniser.due_us, quiet_since_us + QUIET_US)

    @property
    def next_deadline_us(self) -> int | None:
        """When `advance` has something to do; None while there is no port."""
        if self.phase is Phase.CLOSED:
            return None
        if self.phase is Phase.GREETING:
            return self._greeting.due_us
        deadlines = [
            self._heard_us + SILENCE_US,
            self._requests.next_deadline_us,
            self._setpoints.repeat_due_us,
            self._ping_due_us,
        ]
        return min(deadline for deadline in deadlines if deadline is not None)

    def take_output(self) -> bytes:
        """The bytes to send, once."""
        output = bytes(self._output)
        self._output.clear()
        return output

    # --- what the application asks for ---------------------------------------------------------

    def check_open(self) -> None:
        """Raise why the session is not open, if it is not."""
        if self.phase is not Phase.OPEN:
            raise self.error.with_traceback(None)  # it may be raised for hours: let none pile up

    def drive_velocity(
        self, left_mps: float, right_mps: float, expiry_us: int, now_us: int
    ) -> None:
        """Send a velocity setpoint that is void from the host's `expiry_us` on.

        Raises:
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
        self._setpoints.clear()
        message = Stop(self._session_id, 0, self._setpoints.last_seq, mode)
        self._submit_urgent(message, done, now_us)

    def estop(self, done: Done, now_us: int) -> None:
        """Stop and latch. Without a session it is sent unacknowledged."""
        self._setpoints.clear()
        self._submit_urgent(Estop(self._session_id, 0), done, now_us)

    def request(self, message: RequestMessage, done: Done, now_us: int) -> None:
        """Send a request; its session_id and request_id are filled in.

        Raises:
            LinkLost: The session is not open.
        """
        self.check_open()
        self._requests.submit(message._replace(session_id=self._session_id), done, now_us)

    def statistics(self, now_us: int) -> LinkStatistics:
        """A snapshot of what was counted."""
        counters, clock = self._decoder.counters, self._synchroniser.clock
        return LinkStatistics(
            frames_sent=self._frames_sent,
            frames_received=counters.frames,
            frames_lost=counters.seq_lost,
            bad_crc=counters.bad_crc,
            bad_cobs=counters.bad_cobs,
            unknown_id=counters.unknown_id,
            wrong_length=counters.wrong_length,
            repeated=counters.repeated,
            stale_states=self._sampler.stale,
            invalid=self._invalid,
            foreign=self._foreign,
            refused=self._refused,
            requests_repeated=self._requests.repeated,
            setpoints_repeated=self._setpoints.repeated,
            sessions=self._sessions,
            device_resets=self._boots.resets,
            round_trip_p50_us=quantile(self._round_trips, 0.50),
            round_trip_p99_us=quantile(self._round_trips, 0.99),
            clock_error_us=clock.error_us(now_us) if clock.synchronised else float("nan"),
        )

    # --- opening and ending --------------------------------------------------------------------

    def _greet(self, error: WheelwireError, now_us: int, pause_us: int = 0) -> None:
        """End what there was and begin a session, under a new nonce."""
        self._end(error)
        self.phase = Phase.GREETING
        self._greeting.begin(now_us, pause_us)

    def _end(self, error: WheelwireError) -> None:
        self.phase = Phase.CLOSED
        self.error = error
        self._session_id = 0
        self._setpoints.clear()
        self._requests.abort(error)

    def _on_hello(self, hello: DeviceHello, now_us: int) -> None:
        if hello.nonce != self._greeting.nonce:
            self._foreign += 1
            return
        self.answered = True
        if self.phase in _IN_SESSION:
            if self._boots.is_new(hello.boot_id):
                self._greet_after_reset(now_us)
            return
        try:
            device = self._greeting.judge(hello)
        except WheelwireError as error:
            self.error = error
        except ValueError:
            self._invalid += 1
        else:
            self._begin(device, now_us)

    def _begin(self, device: DeviceInfo, now_us: int) -> None:
        self._boots.enter(device.boot_id)
        self.device = device
        self.values.clear()
        self.phase = Phase.SYNCHRONISING
        self._sessions += 1
        self._session_id = self._greeting.nonce ^ device.boot_id
        self._heard_us = now_us
        self._decoder.restart_sequence()
        self._request_id = 0
        self._setpoints.begin_session()
        self._synchroniser = self._new_synchroniser(now_us)
        self._synchroniser.ping(now_us)

    def _new_synchroniser(self, now_us: int) -> Synchroniser:
        return Synchroniser(self._session_id, self._send, self._next_id, now_us)

    def _prepare_when_ready(self, now_us: int) -> None:
        """Once the clock is known, settle what a session needs before it is called open."""
        if self.phase is not Phase.SYNCHRONISING or not self._synchroniser.ready:
            return
        self.phase = Phase.PREPARING
        session = self._session_id
        steps: list[RequestMessage] = [ParameterGet(session, 0, id_) for id_ in self._watched]
        if self.stream_rate_hz is not None:
            steps.append(SetStreamRate(session, 0, self.stream_rate_hz))

        def done(error: WheelwireError | None) -> None:
            if self.phase is not Phase.PREPARING:
                return  # the session ended
            if error is None:
                self.phase = Phase.OPEN
            else:
                self._greet(error, now_us, RETRY_US)

        self._requests.submit_all(steps, done, now_us)

    def _greet_after_reset(self, now_us: int) -> None:
        self._greet(LinkLost("the device was reset; a new session is being opened"), now_us)

    # --- messages ------------------------------------------------------------------------------

    def _in_session(self, session_id: int, now_us: int) -> bool:
        ours = self.phase in _IN_SESSION and session_id == self._session_id
        if ours:
            self._heard_us = now_us
        else:
            self._foreign += 1
        return ours

    def _on_pong(self, pong: Pong, now_us: int) -> None:
        if not self._in_session(pong.session_id, now_us):
            return
        exchange = self._synchroniser.on_pong(pong, now_us)
        if exchange is None:
            self._foreign += 1
            return
        self._round_trips.append(exchange.round_trip_us)
        self._prepare_when_ready(now_us)

    def _on_state(self, state: WheelState, now_us: int) -> None:
        if not self._of_this_boot(state.boot_id, now_us) or self.phase is not Phase.OPEN:
            return
        try:
            sample = self._sampler.sample(state, self._synchroniser.clock, now_us)
        except ValueError:
            self._invalid += 1
            return
        if sample is not None:
            self._samples.append(sample)
            self._setpoints.supervisor = sample.state
            self._setpoints.on_obeyed(sample.command_seq)

    def _on_event(self, event: Event, now_us: int) -> None:
        if not self._of_this_boot(event.boot_id, now_us):
            return
        try:
            self._setpoints.supervisor = SupervisorState(event.after)
        except ValueError:
            self._invalid += 1

    def _of_this_boot(self, boot_id: int, now_us: int) -> bool:
        """False outside a session and for another boot; a reset is answered with a hello."""
        if self.phase not in _IN_SESSION or self.device is None:
            return False
        if self._boots.is_new(boot_id):
            self._greet_after_reset(now_us)
        ours = self.device.boot_id == boot_id
        if ours:
            self._heard_us = now_us
        return ours

    def _on_refuse(self, refuse: Refuse, now_us: int) -> None:
        if not self._in_session(refuse.session_id, now_us):
            return
        self._refused += 1
        if refuse.code == RefusalCode.NO_SESSION:
            error = LinkLost("the device no longer knows this session; opening a new one")
            self._greet(error, now_us)
            return
        if refuse.message_id in SETPOINT_IDS:
            self._setpoints.on_refused(refuse)
        elif not self._requests.on_refuse(refuse, now_us):
            self._foreign += 1

    def _on_answer(self, answer: Answer, now_us: int) -> None:
        if not self._in_session(answer.session_id, now_us):
            return
        if not self._requests.on_answer(answer, now_us):
            self._foreign += 1
        elif isinstance(answer, (ParameterValue, ParameterEntry)):
            self.values[answer.parameter] = answer.value
        elif isinstance(answer, Ack) and answer.message_id in _CLEARS:
            self._setpoints.clear()

    # --- sending -------------------------------------------------------------------------------

    def _drive(self, setpoint: Setpoint, expiry_us: int, now_us: int) -> None:
        self.check_open()
        self._setpoints.check()
        expiry = self._synchroniser.clock.host_to_device(expiry_us)
        dated = setpoint._replace(session_id=self._session_id, expiry_us=expiry)
        self._setpoints.submit(dated, expiry_us, now_us)

    def _submit_urgent(self, message: Stop | Estop, done: Done, now_us: int) -> None:
        if self.phase is Phase.OPEN:
            self._requests.submit(message, done, now_us)
            return
        if self.phase is not Phase.CLOSED:
            self._send(message)
        done(self.error)

    def _next_id(self) -> int:
        self._request_id = (self._request_id + 1) % ID_MODULUS
        return self._request_id

    def _send(self, message: AnyMessage) -> None:
        self._frames_sent += 1
        self._output += self._encoder.encode(message)
