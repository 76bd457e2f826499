"""One host's session with one device: hello, preparation, and dispatch of messages.

    CLOSED -> HELLO -> PREPARING -> OPEN      and from any of them back to HELLO or CLOSED

Hello is repeated until the device answers. Then the clock is synchronised, the stream rate set, the
watched parameters fetched, and the device's board compared with the expected one, if there is one;
after that the session is open. It ends when the port closes, when
the device falls silent or is reset, and when the device no longer knows the session.

All inputs that decide what it does are passed on first, so that it can be run again
(`traffic.Kind`).

Sans-IO: bytes and times in; bytes, samples and the next deadline out, so that it runs in virtual
time as well. All times are microseconds of one monotonic host clock. One thread owns a session;
any other may ask for a setpoint's frame meanwhile, to write it itself. That needs no lock: what it
uses of the session is one object, which is replaced as a whole.
"""

from __future__ import annotations

import enum
import json
import logging
import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, replace
from functools import partial
from itertools import count
from typing import Any

from wheelwire_protocol.board import ConfigurationState
from wheelwire_protocol.codec import PROTOCOL_VERSION, message_id, schema_hash
from wheelwire_protocol.codes import (
    Capability,
    EventCode,
    Fault,
    Group,
    RefusalCode,
    StopMode,
    SupervisorState,
    TrialAction,
)
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder, encode_frame
from wheelwire_protocol.types import (
    ANSWERS,
    Ack,
    AnyMessage,
    ClearEstop,
    ClearFault,
    ConfigurationConfirm,
    ConfigurationGet,
    ConfigurationValue,
    DeviceHello,
    Estop,
    Event,
    GroupGet,
    GroupInfo,
    Hello,
    Hold,
    Imu,
    Inputs,
    ParameterEntry,
    ParameterGet,
    ParameterReset,
    ParameterSave,
    ParameterSet,
    ParameterTrial,
    ParameterValue,
    Pong,
    Power,
    Range,
    Refuse,
    SensorEvent,
    SensorInfo,
    SensorStream,
    SetStreamRate,
    Stop,
    WheelState,
)

from ..errors import (
    NO_FAULT,
    BoardMismatch,
    DeviceRefused,
    LinkLost,
    WheelwireError,
    WrongBoard,
    afresh,
)
from ..holds import HeldBy, LastStop
from .clock import ClockEstimator, Liveness, Synchroniser
from .info import (
    ActiveBoard,
    BootHistory,
    DeviceInfo,
    ExpectedBoard,
    LinkStatistics,
    RecentCounts,
    RoundTrips,
    device_of_session,
    quantile,
)
from .notices import Happening, Notice, StandingNotice
from .plain_text import PlainText
from .requests import COPY_ID, Answer, Done, HeldTrial, RequestMessage, RequestQueue, subject
from .sample_stream import Measurement, StateStream
from .sensor_stream import SensorStream as Sensors
from .setpoints import REARM_GAP, SETPOINT_IDS, TTL_MAX, OpenSession, SetpointSender
from .traffic import ATTACHED, ESTOP, Kind, Traffic, TrafficReader

NO_SESSION = 0
"""The id in a message that belongs to no session."""
HELLO_PERIOD_US = 30_000
RETRY_US = 1_000_000
"""Until the next hello after the device opened a session but refused to be prepared."""

_CHANGES = (ParameterSet, ParameterSave, ParameterReset, ParameterTrial)
"""Requests that an application sends for the values that are on trial."""
_COPIES = (
    EventCode.CONFIGURATION_COPY_LOST,
    EventCode.PARAMETERS_COPY_LOST,
    EventCode.LATCHES_COPY_LOST,
)
_CLEARS = (message_id(ClearEstop), message_id(ClearFault))
_LOG = logging.getLogger("wheelwire")
_LINK_LOG = logging.getLogger("wheelwire.link")


class Phase(enum.Enum):
    """Phase of the session."""

    CLOSED = enum.auto()
    """No port."""
    HELLO = enum.auto()
    """Hello is repeated until answered."""
    PREPARING = enum.auto()
    """The clock is being synchronised, stream rate and parameters are being set."""
    OPEN = enum.auto()


class Session:
    """The host's side of the link, for one session after another.

    Args:
        nonce: Draws 32 random bits for each session.
        stream_rate_hz: Rate of the state frames; None keeps the device's own.
        watched: Ids of parameters whose values are read whenever a session opens.
        any_board: Whether to continue with another board than that of the first session.
        settings: Parameter id -> the value that the device is given whenever a session opens.
        expected_board: The board that the device has to be on; on another one no session opens.

    Attributes:
        board: What is known in this session of the device's board; None where it cannot tell.
        copies_lost: Of which stored blocks the device's start found only one of two copies.
        rolling_mps: How fast the robot rolled, by the device's report, although nothing drives it;
            None before there is one, and once it slowed down or drives.
        hold: What the device said last of what holds it, and of its last stop; None before that.
        phase: Phase of the session.
        id: Its id on the wire; 0 outside one.
        error: Why the session is not open; meaningless while it is.
        device: The device of the newest session.
        count: Number of sessions so far.
        answers: Number of answers to hellos, whether a session was opened or not.
        unanswered_since_us: Since when hellos have gone unanswered; None during a session or
            without a port.
        values: Parameter id -> the newest value reported by the device in this session.
        watched_values: Parameter id -> value of the watched parameters; None while no session is
            open. Replaced as a whole when one of them changes.
        bytes_received: Since the start.
        plain_text: That came in place of frames since the device last answered.
        frames_received: Good frames of known messages, since the start.
        sensors: What the sensors measure, once the application asked for it.
        setpoints: Makes the frames of setpoints, for any thread.
        output: Bytes that `take_output` would return.
        notices: What has happened, in order; whoever serves the session takes it out.
        traffic: Passes on what this session is given.
        warn: Takes what the user should know, as `logging.warning` does.
        warn_held: The same for setpoints that are held; silent in a session that is followed.
    """

    def __init__(
        self,
        nonce: Callable[[], int],
        stream_rate_hz: int | None = None,
        watched: Sequence[int] = (),
        *,
        any_board: bool = False,
        settings: Mapping[int, float] | None = None,
        expected_board: ExpectedBoard | None = None,
    ) -> None:
        self.phase = Phase.CLOSED
        self.id = 0
        self.board: ActiveBoard | None = None
        self.copies_lost: tuple[EventCode, ...] = ()
        self.rolling_mps: float | None = None
        self.hold: Hold | None = None
        self.error: WheelwireError = LinkLost("the port was not opened yet")
        self.device: DeviceInfo | None = None
        self.count = 0
        self.answers = 0
        self.unanswered_since_us: int | None = None
        self.values: dict[int, float] = {}
        self.watched_values: Mapping[int, float] | None = None
        self.bytes_received = 0
        self.plain_text = PlainText()
        self.frames_received = 0
        self.notices: deque[Notice] = deque()
        self.traffic = Traffic()
        self.warn: Callable[..., None] = _LOG.warning
        self.warn_held: Callable[..., None] = _LINK_LOG.warning

        self._joining: list[TrafficReader] = []
        """The readers that listen as soon as the session is prepared."""
        self._draw_nonce = nonce
        self._stream_rate_hz = stream_rate_hz
        self._watched = tuple(watched)
        self._settings = dict(settings or {})
        self._any_board = any_board
        self._expected_board = expected_board
        self._asks_for_board = False
        """Until the device has said which board it is on, or that it cannot tell."""
        self._own_questions = 0
        """Beside those that prepare the session; what follows from an answer is another one."""

        self._encoder = Encoder()
        self._decoder = Decoder()
        self.output = bytearray()
        self._frames_sent_before = 0
        """Frames that the encoders of earlier connections made."""
        self._invalid = 0
        self._foreign = 0
        self._refused = 0
        self._round_trips = RoundTrips()
        self._recent = RecentCounts()
        self._latched = NO_FAULT
        """Faults that the device has reported to be latched. They outlast sessions and resets."""
        self._reported_held = HeldBy()
        """What was last reported to the listener; outlasts sessions, too."""

        self._nonce = 0
        self._hello_due_us = 0
        self._boot_id: int | None = None
        """The device's boot id; None outside a session."""
        self._hello: DeviceHello | None = None
        """What began the newest session."""
        self._command_seqs = count(1)
        self._boots = BootHistory()
        self._liveness = Liveness(0)
        self._unprepared = 0
        """Requests that prepare the session and are not answered yet."""
        self._preparation_failure: WheelwireError | None = None
        """Of the first of them that failed."""

        self._requests = RequestQueue(self._send)
        self._trial = HeldTrial()
        # The reason is replaced at each loss, so it is looked up when it is needed.
        self.setpoints = SetpointSender(
            self._send,
            self._trial,
            lambda: self.error,
            self.traffic,
            lambda *words: self.warn_held(*words),
        )
        self._state_stream = StateStream()
        self.sensors = Sensors()
        # It belongs to no session: `statistics` may be asked for before the first one.
        self._synchroniser = Synchroniser(0, self._send, 0)
        # Without WheelState, which `receive` collects itself.
        self._handlers: dict[type[AnyMessage], Callable[..., None]] = {
            DeviceHello: self._on_hello,
            Pong: self._on_pong,
            Event: self._on_event,
            Refuse: self._on_refuse,
            **dict.fromkeys((Ack, *ANSWERS.values()), self._on_answer),
            Hold: self._on_hold,
            SensorInfo: self._on_sensor_info,
            Imu: partial(self._on_sensed, self.sensors.take_imu),
            Power: partial(self._on_sensed, self.sensors.take_power),
            Range: partial(self._on_sensed, self.sensors.take_range),
            Inputs: partial(self._on_sensed, self.sensors.take_inputs),
            SensorEvent: partial(self._on_sensed, self.sensors.take_event),
        }

    def statistics(self, now_us: int) -> LinkStatistics:
        """A snapshot of all counters."""
        counters, clock = self._decoder.counters, self._synchroniser.clock
        rate_hz, loss = self._recent.rate_and_loss(
            now_us, self._state_stream.new, self.frames_received, counters.seq_lost
        )
        return LinkStatistics(
            frames_sent=self._frames_sent_before + self._encoder.encoded,
            frames_received=self.frames_received,
            frames_lost=counters.seq_lost,
            bad_crc=counters.bad_crc,
            bad_cobs=counters.bad_cobs,
            unknown_id=counters.unknown_id,
            wrong_length=counters.wrong_length,
            repeated=counters.repeated,
            stale_states=self._state_stream.stale,
            invalid=self._invalid,
            foreign=self._foreign,
            refused=self._refused,
            requests_repeated=self._requests.repeated,
            setpoints_repeated=self.setpoints.repeated,
            setpoints_expired=self.setpoints.expired,
            sessions=self.count,
            device_resets=self._boots.resets,
            round_trip_p50_us=quantile(self._round_trips.newest_us, 0.50),
            round_trip_p99_us=quantile(self._round_trips.newest_us, 0.99),
            clock_error_us=(
                clock.conversion.host_to_device(now_us)[1] if clock.synchronised else float("nan")
            ),
            state_rate_hz=rate_hz,
            recent_loss=loss,
        )

    # --- the port ------------------------------------------------------------------------------

    def connect(self, now_us: int) -> None:
        """The port is open: say hello. Sequence numbers restart, and queued output is dropped."""
        self.traffic.put(Kind.CONNECTED, now_us)
        self._frames_sent_before += self._encoder.encoded
        # A new encoder, not the old one restarted: another thread may be encoding a setpoint.
        self._encoder = Encoder()
        self._decoder.restart()
        self.output.clear()
        self._begin_hello(
            LinkLost("the port is there, but the device has not answered yet"), now_us
        )

    def renew(self, error: WheelwireError, now_us: int) -> None:
        """Begin a new session if one was begun: its state is no longer valid."""
        self.traffic.put(Kind.RENEWED, now_us, str(error).encode())
        if self._in_session:
            self._begin_hello(error, now_us)

    def disconnect(self, error: WheelwireError) -> None:
        """The port is gone: every open request fails with `error`."""
        self.traffic.put(Kind.DISCONNECTED, self.traffic.host_us, str(error).encode())
        self._end(error)
        # The rest was meant for this device; another may be behind the next port.
        self.output.clear()
        self._join()

    def receive(self, data: bytes, now_us: int, *, every_state: bool = False) -> list[Measurement]:
        """Process bytes, whatever they are; returns what was measured anew.

        That is the newest of the state frames that arrive together, or with `every_state` each.
        """
        if self.traffic.readers:
            self.traffic.put(Kind.RECEIVED_EACH if every_state else Kind.RECEIVED, now_us, data)
        # Noise counts: bytes without an answer tell a foreign device from a silent one.
        self.bytes_received += len(data)
        if now_us >= self._recent.due_us:
            lost = self._decoder.seq_lost
            self._recent.note(now_us, self._state_stream.new, self.frames_received, lost)
        messages = self._decoder.feed(data) or self._text_in(data)
        self.frames_received += len(messages)
        found: list[Measurement] = []
        states: list[WheelState] = []
        for message in messages:
            # Most messages are this, and no function is called that they do not need.
            if type(message) is WheelState and message.boot_id == self._boot_id:
                self._liveness.heard_us = now_us
                # Before the session is open the clock is unknown, so a state has no stamp.
                if self.phase is Phase.OPEN:
                    # A fast stream brings several in one read, and all but the newest are out of
                    # date: they are collected, and one of them becomes a measurement.
                    states.append(message)
                    if every_state:
                        self._take_states(states, found, now_us)
                continue
            if states:  # before the message that came after them: it may end the session
                self._take_states(states, found, now_us)
            self._take(message, now_us)
        if states:
            self._take_states(states, found, now_us)
        # At once, not at the next `advance`: the last answer may just have come.
        if self.phase is Phase.PREPARING or self._joining:
            self._go_on(now_us)
        return found

    def _go_on(self, now_us: int) -> None:
        """Open the session and have readers join, if what has come was all that was missing."""
        if self.phase is Phase.PREPARING:
            self._open_when_prepared(now_us)
        self._join()

    def _take(self, message: AnyMessage, now_us: int) -> None:
        """Take any message but a state of this boot."""
        if type(message) is WheelState:  # in any phase it may be a sign of a reset
            self._is_this_boot(message.boot_id, now_us)
            return
        handler = self._handlers.get(type(message))
        if handler is None:
            self._foreign += 1  # a message that only hosts send: an echo
        else:
            handler(message, now_us)

    def _text_in(self, data: bytes) -> list[AnyMessage]:
        """Read the text of a chip that does not run and may say why; no message is in it."""
        text = self.plain_text
        if self.phase is Phase.HELLO and text.feed(data):
            said = f"the device does not answer, and sends {text.quote!r}: {text.sentence}"
            self.error = LinkLost(said)
            if self.count:  # else opening it raises this
                self.warn_held("%s", said)
        return []

    def advance(self, now_us: int) -> None:
        """Do what is due: hello, pings, repeats, the end of a session whose device is silent."""
        if self.traffic.readers:
            self.traffic.put(Kind.ADVANCED, now_us)
        if self.phase is Phase.HELLO:
            self._say_hello(now_us)
        elif self.phase is not Phase.CLOSED and now_us >= self._liveness.silent_us:
            silent = LinkLost(
                "the device fell silent; saying hello until it answers",
                causes=("cable_pulled", "power_lost"),
            )
            self._begin_hello(silent, now_us)
        if self._in_session:
            self._requests.advance(now_us)
            self.setpoints.advance(now_us)
            if now_us >= self._ping_due_us:
                self._synchroniser.ping(now_us)
            sensors_due_us = self.sensors.due_us
            if sensors_due_us is not None and now_us >= sensors_due_us:
                self._ask(self._sensor_request(), lambda _: None, now_us)
            renewal = self._trial.renewal(now_us)
            if renewal is not None:
                renewal = renewal._replace(session_id=self.id)
                # Whatever comes of it: a refusal for want of a trial ends the session.
                self._requests.submit(renewal, lambda _: self._trial.renewed(), now_us)
            # The last ping of the burst may have been all that was missing.
            if self.phase is Phase.PREPARING:
                self._open_when_prepared(now_us)

    @property
    def next_deadline_us(self) -> int | None:
        """When `advance` is due next; None while there is no port."""
        if self.phase is Phase.CLOSED:
            return None
        if self.phase is Phase.HELLO:
            return self._hello_due_us
        others = (
            self._requests.next_deadline_us,
            self.setpoints.repeat_due_us,
            self._trial.due_us,
            self.sensors.due_us,
        )
        due_us = min(self._liveness.silent_us, self._ping_due_us)
        for other_us in others:
            if other_us is not None and other_us < due_us:
                due_us = other_us
        return due_us

    def awaits_answer(self, now_us: int) -> bool:
        """Whether the link has to handle what arrives without delay."""
        # A pong that is read late makes the bound of the clock wider.
        return (
            self.phase is not Phase.OPEN
            or self._requests.next_deadline_us is not None
            or self.setpoints.awaits_fate
            or self._synchroniser.awaits_pong(now_us)
        )

    def take_output(self) -> bytes:
        """Return the bytes to send, and forget them."""
        output = bytes(self.output)
        self.output.clear()
        return output

    # --- what the application asks for ---------------------------------------------------------

    def check_connected(self) -> None:
        """Raise the reason if there is no port."""
        if self.phase is Phase.CLOSED:
            raise afresh(self.error)

    def check_open(self) -> None:
        """Raise the reason if the session is not open."""
        if self.phase is not Phase.OPEN:
            raise afresh(self.error)

    @property
    def knows_device(self) -> bool:
        """Whether it is open, and the device has said which board it has.

        What the device cannot tell, or whose answer was lost, is not waited for any longer.
        """
        return self.phase is Phase.OPEN and not self._own_questions

    def stop(self, mode: StopMode | None, done: Done, now_us: int) -> None:
        """Void the setpoint and stop, with None latch. Without a session it is not acknowledged."""
        self.traffic.put(Kind.STOP, now_us, bytes([ESTOP if mode is None else mode]))
        message: Stop | Estop
        if mode is None:
            message = Estop(self.id, 0)
        else:
            # Numbered from the setpoints' counter, so that those still on their way are void.
            message = Stop(self.id, 0, next(self._command_seqs), mode)
        # First, so that no repeat of an earlier setpoint goes out behind the stop.
        self.setpoints.on_stop()
        self._send_stop(message, done, now_us)

    def stop_for_attached(self, done: Done, now_us: int) -> None:
        """Stop in the configured mode, for a program that is attached; of no session.

        So it replaces no stop of the session by a weaker one, and uses up no setpoint's number.
        """
        self.traffic.put(Kind.STOP, now_us, bytes([ATTACHED]))
        message = Stop(NO_SESSION, 0, 0, StopMode.CONFIGURED)
        self.setpoints.void()  # what was sent before it is not to be repeated behind it
        self._send_stop(message, done, now_us)

    def _send_stop(self, message: Stop | Estop, done: Done, now_us: int) -> None:
        if self.phase is Phase.OPEN:
            self._requests.submit(message, done, now_us)
            return
        # The device obeys a stop of anybody, so it is sent even while there is no session to
        # acknowledge it in; whether it arrived is then not known.
        if self.phase is not Phase.CLOSED:
            self._send(message)
        done(self.error)

    def request(self, message: RequestMessage, done: Done, now_us: int) -> None:
        """Send a request; its session_id and request_id are filled in.

        Raises:
            LinkLost: The session is not open.
            DeviceRefused: It belongs to a trial of parameters that was lost.
        """
        if self.traffic.readers:
            self.traffic.put(Kind.REQUEST, now_us, encode_frame(message, 0))
        self.check_open()
        # A revert passes the check: it is how an application leaves a trial that was lost.
        reverts = isinstance(message, ParameterTrial) and message.action == TrialAction.REVERT
        if isinstance(message, _CHANGES) and not reverts:
            self._trial.check(subject(message))
        if isinstance(message, ParameterTrial):
            self._trial.on_request(message)
        if reverts or isinstance(message, (ClearEstop, ClearFault)):
            self.setpoints.void()  # only what is commanded from now on may move the wheels
        self._requests.submit(message._replace(session_id=self.id), done, now_us)

    def release_trial(self) -> None:
        """The application has left its trial of parameters; from any thread."""
        self.traffic.put(Kind.RELEASED, self.traffic.host_us)
        self._trial.release()

    def standing_notice(self, happening: Happening) -> StandingNotice | None:
        """What a listener hears of what is so already; None if there is nothing."""
        if happening is Happening.LOST and self.phase is not Phase.OPEN:
            return StandingNotice(happening, afresh(self.error))
        if happening is Happening.FAULT and self._latched:
            return StandingNotice(happening, self._latched)
        if happening is Happening.HELD and self.hold is not None and self.hold.held:
            return StandingNotice(happening, self.held_by(self.hold))
        return None

    def watch(self, parameters: Sequence[int]) -> None:
        """Watch these parameters, from the next session on."""
        self._watched = tuple(parameters)

    def withdraw(self, done: Done) -> None:
        """The caller has given up: the session sends no more copies of the request."""
        if self.traffic.readers:
            which = self._requests.places(done)
            self.traffic.put(
                Kind.WITHDRAWN, self.traffic.host_us, struct.pack(f"<{len(which)}I", *which)
            )
        self._requests.withdraw(done)

    def withdraw_places(self, places: Sequence[int]) -> None:
        """As `withdraw`, by what `RequestQueue.places` returned for another session like this."""
        for done in self._requests.waiting_at(places):
            self._requests.withdraw(done)

    def use_nonce(self, nonce: int) -> None:
        """Continue with the nonce that another session like this has drawn."""
        self._nonce = nonce

    # --- hello, and the end of a session -------------------------------------------------------

    @property
    def _in_session(self) -> bool:
        """Whether the device has opened a session; it may not be ready for use yet."""
        return self.phase in (Phase.PREPARING, Phase.OPEN)

    def _begin_hello(self, error: WheelwireError, now_us: int, pause_us: int = 0) -> None:
        """End the current session and, after a pause, say hello with a new nonce."""
        self._end(error)
        self.phase = Phase.HELLO
        # Nobody asks during the pause, so it does not count as silence of the device.
        self.unanswered_since_us = now_us + pause_us
        # A new one, so that a late answer to a previous hello cannot begin this session.
        self._nonce = self._draw_nonce()
        self.traffic.put(Kind.NONCE, now_us, struct.pack("<I", self._nonce))
        self._hello_due_us = now_us + pause_us
        self._say_hello(now_us)
        self._join()

    def _say_hello(self, now_us: int) -> None:
        if now_us >= self._hello_due_us:
            self._hello_due_us = now_us + HELLO_PERIOD_US
            self._send(Hello(self._nonce, PROTOCOL_VERSION, schema_hash()))

    def _end(self, error: WheelwireError) -> None:
        self.error = error  # first: other threads read it as soon as they see the phase
        if self.phase is Phase.OPEN:
            self.notices.append((Happening.LOST, afresh(error)))
        self.phase = Phase.CLOSED
        self.watched_values = None
        self.rolling_mps = None
        self.hold = None
        self.setpoints.end_session()
        self.sensors.forget()
        self.id, self._boot_id = 0, None
        self.unanswered_since_us = None
        self._trial.lose()  # first: whoever hears of the end may drive again at once
        self._requests.abort(error)

    def _on_hello(self, hello: DeviceHello, now_us: int) -> None:
        """Handle an answer to a hello, which may begin a session."""
        if hello.nonce != self._nonce:
            self._foreign += 1
            return
        self.answers += 1
        self.plain_text.forget()
        if self._in_session:  # the answer to a repeated hello
            self._begin_anew_if_reset(hello.boot_id, now_us)
            return
        # Even a refusal is an answer: the port need not be opened again.
        self.unanswered_since_us = now_us
        first = self.device
        try:
            device = device_of_session(hello)
            if first and device.board_id != first.board_id and not self._any_board:
                raise WrongBoard(first.board_id, device.board_id)
        except WheelwireError as error:
            # Hellos go on: the device may be flashed, or exchanged, while the program waits.
            self.error = error
        except ValueError:
            self._invalid += 1
        else:
            self._hello = hello
            self._begin(device, now_us)

    def _begin(self, device: DeviceInfo, now_us: int) -> None:
        """The device has opened a session: synchronise the clock, send preparing requests."""
        if self.count and self._boots.is_new(device.boot_id):
            self.setpoints.hold(now_us)
            self.copies_lost = ()
        self._boots.enter(device.boot_id)
        if self.device is None or self.device.board_id != device.board_id:
            self._latched = NO_FAULT
        self.device = device
        self.phase = Phase.PREPARING
        self.unanswered_since_us = None
        self.count += 1
        self.id, self._boot_id = self._nonce ^ device.boot_id, device.boot_id
        self._liveness = Liveness(now_us)
        # The device may have been reset, which sets its frame numbers back: nothing was lost.
        self._decoder.restart_sequence()
        # A device that was reset has its saved values again: those known are void.
        self.values.clear()
        self._requests.begin_session()
        # Again: a thread that was making a frame when the previous session ended may have queued it
        # for a repeat since.
        self.setpoints.clear()
        self.setpoints.moves_until_us = 0  # a new session voids the setpoint of the one before
        self._command_seqs = count(1)
        # Requests and pings go out together: whichever takes longer decides when it is open.
        self._synchroniser = Synchroniser(self.id, self._send, now_us)
        self._synchroniser.ping(now_us)
        # Settings before watched values: what is read then is what is active.
        needed: list[RequestMessage] = [
            ParameterSet(self.id, 0, id_, value) for id_, value in self._settings.items()
        ]
        needed += [ParameterGet(self.id, 0, id_) for id_ in self._watched]
        if self._stream_rate_hz is not None:
            needed.append(SetStreamRate(self.id, 0, self._stream_rate_hz))
        self._unprepared = len(needed)
        self._preparation_failure = None
        for message in needed:
            self._requests.submit(message, self._on_prepared, now_us)
        self._ask_for_board(device, now_us)

    def _ask_for_board(self, device: DeviceInfo, now_us: int) -> None:
        """Ask for the device's board; the session needs the answer only if it expects one."""
        self.board = None
        # Only a device that restarts when asked can have another board.
        self._asks_for_board = Capability.RESTART in device.capabilities

        def end(_: Answer | WheelwireError) -> None:
            self._asks_for_board = False

        # If the board stays the same, only a program that uses the sensors needs it.
        if self._asks_for_board or self.sensors.rate_hz:
            # The answer is recorded like every other one.
            self._ask_for_group(Group.CONFIGURATION, ConfigurationGet(self.id, 0), end, now_us)
        if self.sensors.rate_hz:
            self._ask_for_group(Group.SENSOR, self._sensor_request(), lambda _: None, now_us)

    def _ask_for_group(
        self, group: Group, question: RequestMessage, done: Done, now_us: int
    ) -> None:
        """Ask `question`, if the device means the same by the messages of that group."""

        def take_group(answer: Answer | WheelwireError) -> None:
            # A device of another release may mean something else by them.
            if isinstance(answer, GroupInfo) and answer.hash == schema_hash(group):
                self._ask(question, done, now_us)
            else:
                done(answer)

        self._ask(GroupGet(self.id, 0, group), take_group, now_us)

    def _ask(self, message: RequestMessage, done: Done, now_us: int) -> None:
        """Send a request of the session's own, beside those that prepare it."""
        self._own_questions += 1

        def take(answer: Answer | WheelwireError) -> None:
            done(answer)
            # After it: what it asks for next is counted before another thread finds zero.
            self._own_questions -= 1

        self._requests.submit(message, take, now_us)

    def _sensor_request(self) -> SensorStream:
        """As the application asked before, in this session or in an earlier one."""
        self.sensors.due_us = None
        return SensorStream(self.id, 0, self.sensors.rate_hz)

    def _board_mismatch(self) -> BoardMismatch | None:
        expected, found = self._expected_board, self.board
        if expected is None:
            return None
        if found is None:
            return BoardMismatch(expected.name, "unknown: the device cannot tell")
        if found.state is ConfigurationState.DAMAGED:
            return BoardMismatch(expected.name, "none")
        has = found.bare_fingerprint if expected.is_bare else found.fingerprint
        if has != expected.fingerprint:
            # Of the same name with other pins or peripherals.
            another = " with other pins or sensors" * (found.name == expected.name)
            return BoardMismatch(expected.name, found.name + another, confirmed=found.is_confirmed)
        return None

    def _on_prepared(self, answer: Answer | WheelwireError) -> None:
        self._unprepared -= 1
        if isinstance(answer, WheelwireError) and self._preparation_failure is None:
            self._preparation_failure = answer

    def _open_when_prepared(self, now_us: int) -> None:
        """Open the session once it is prepared; start over if preparing it failed."""
        failure = self._preparation_failure
        if failure is not None:
            # A refusal would be repeated at once, and for ever; a lost answer may come next time.
            pause_us = RETRY_US if isinstance(failure, DeviceRefused) else 0
            self._begin_hello(failure, now_us, pause_us)
        elif not self._unprepared and self._synchroniser.ready:
            if self._expected_board is not None and self._asks_for_board:
                return
            mismatch = self._board_mismatch()
            if mismatch is not None:
                # Hellos go on: the board may be written while the program waits.
                self._begin_hello(mismatch, now_us, RETRY_US)
                return
            # The phase last: whoever sees it may send a setpoint at once.
            self._collect_watched()
            opened = OpenSession(
                self.id, self._synchroniser.clock, self._command_seqs, self._encoder
            )
            self.setpoints.open(opened, now_us)
            self.phase = Phase.OPEN
            self.notices.append((Happening.OPENED, self.device))
            self._report_held()
            self._join()

    def _collect_watched(self) -> None:
        """Replace the watched values, unless one is still missing."""
        known = self.values
        if all(parameter in known for parameter in self._watched):
            self.watched_values = {parameter: known[parameter] for parameter in self._watched}

    # --- what the device says ------------------------------------------------------------------

    def _is_ours(self, session_id: int, now_us: int) -> bool:
        """Whether a message belongs to this session. If so, the device counts as heard."""
        ours = self._in_session and session_id == self.id
        # What belongs to a previous session is no sign of life of this one.
        if ours:
            self._liveness.heard_us = now_us
        else:
            self._foreign += 1
        return ours

    def _is_this_boot(self, boot_id: int, now_us: int) -> bool:
        """As `_is_ours`, but by boot id. An id not seen before means a reset: say hello again."""
        if boot_id == self._boot_id:
            self._liveness.heard_us = now_us
            return True
        if self._boot_id is not None:
            self._begin_anew_if_reset(boot_id, now_us)
        return False

    def _begin_anew_if_reset(self, boot_id: int, now_us: int) -> None:
        if self._boots.is_new(boot_id):
            reset = LinkLost("the device was reset; a new session is being opened")
            self._begin_hello(reset, now_us)

    def _take_states(self, states: list[WheelState], found: list[Measurement], now_us: int) -> None:
        """Add the newest of consecutive state frames to those found, and clear the list."""
        self._liveness.state_us = now_us
        try:
            newest = self._state_stream.newest(states, self._synchroniser.clock, now_us)
        except ValueError:
            self._invalid += 1
        else:
            if newest is not None:
                found.append(newest)
                rolling_mps = self.rolling_mps
                if rolling_mps is not None and not _rolls_on(newest, rolling_mps):
                    self.rolling_mps = None
                self.setpoints.supervisor = newest.supervisor
                self.setpoints.faults = newest.faults
                if newest.faults != self._latched:
                    self._note_latched(newest.faults)
                self.setpoints.on_obeyed(newest.state.command_seq)
        states.clear()

    def _on_pong(self, pong: Pong, now_us: int) -> None:
        if not self._is_ours(pong.session_id, now_us):
            return
        exchange = self._synchroniser.on_pong(pong, now_us)
        if exchange is None:
            self._foreign += 1
        else:
            self._round_trips.add(exchange.round_trip_us)

    def _on_event(self, event: Event, now_us: int) -> None:
        """Track the supervisor: without a stream, only events show its state."""
        if not self._is_this_boot(event.boot_id, now_us):
            return
        if event.code == EventCode.TRIAL_EXPIRED:
            self._begin_after_trial(now_us)
            return
        if event.code == EventCode.ROLLING:
            self.rolling_mps = event.speed_mps
            self.warn(
                "the robot rolls at %.2f m/s although nothing drives it: on a slope, set stop_mode "
                "to 3 (brake until driven) and block the wheels",
                event.speed_mps,
            )
        if event.code in _COPIES and (code := EventCode(event.code)) not in self.copies_lost:
            self.copies_lost = *self.copies_lost, code
            self.warn("%s If it recurs, the flash wears out: replace the board.", code.doc)
        # All other events tell the state in `after`, also those about the stores.
        try:
            self.setpoints.supervisor = SupervisorState(event.after)
            self.setpoints.faults = Fault(event.faults)
            self._note_latched(self.setpoints.faults)
        except ValueError:
            self._invalid += 1

    def _note_latched(self, faults: Fault) -> None:
        if faults & ~self._latched:
            self.notices.append((Happening.FAULT, faults))
        self._latched = faults

    def held_by(self, hold: Hold) -> HeldBy:
        """What holds the robot, by what the device said. From any thread."""
        return HeldBy.of(hold, self.setpoints.faults)

    def last_stop(self, hold: Hold) -> LastStop:
        """What ended the robot's last motion, by what the device said. From any thread."""
        clock, stamp = self._synchroniser.clock, None
        if hold.stop_us and clock.synchronised:
            stamp = clock.conversion.device_to_host(hold.stop_us)[0] / 1e6
        return LastStop.of(hold, stamp)

    def _on_hold(self, hold: Hold, now_us: int) -> None:
        """Take what holds the robot: an answer, or what the device says by itself."""
        if self._in_session and hold.session_id == self.id:
            self._take_hold(hold)
        if hold.request_id:
            self._on_answer(hold, now_us)
        else:
            self._is_ours(hold.session_id, now_us)

    def _take_hold(self, hold: Hold) -> None:
        try:
            HeldBy.of(hold, NO_FAULT)
            LastStop.of(hold, None)
        except ValueError:
            self._invalid += 1
            return
        self.hold = hold
        self._report_held()

    def _report_held(self) -> None:
        if self.phase is not Phase.OPEN or self.hold is None:
            return
        held_by = self.held_by(self.hold)
        if held_by != self._reported_held:
            self._reported_held = held_by
            self.notices.append((Happening.HELD, held_by))

    def _on_sensor_info(self, info: SensorInfo, now_us: int) -> None:
        if self._is_ours(info.session_id, now_us):
            try:
                self.sensors.take_info(info)
            except ValueError:
                self._invalid += 1

    def _on_sensed(
        self,
        take: Callable[[Any, ClockEstimator, int], None],
        message: Imu | Power | Range | Inputs | SensorEvent,
        now_us: int,
    ) -> None:
        """Take a sample or an event of a sensor; before the session is open it has no stamp."""
        if self._is_this_boot(message.boot_id, now_us) and self.phase is Phase.OPEN:
            try:
                take(message, self._synchroniser.clock, now_us)
            except ValueError:
                self._invalid += 1

    def _on_refuse(self, refuse: Refuse, now_us: int) -> None:
        if not self._is_ours(refuse.session_id, now_us):
            return
        self._refused += 1
        # Not reported to one request alone: the end of the session fails them all.
        if refuse.code == RefusalCode.NO_SESSION:
            error = LinkLost(
                "the device no longer knows this session; opening a new one",
                causes=("no_session",),
            )
            self._begin_hello(error, now_us)
            return
        if refuse.message_id in SETPOINT_IDS:
            self.setpoints.refused_us = now_us
            self.setpoints.on_refused(refuse)
        elif not self._requests.on_refuse(refuse, now_us, self.setpoints.faults):
            self._foreign += 1
            return
        # After its caller has the error: the end of the session would report a LinkLost instead.
        if refuse.code == RefusalCode.NO_TRIAL:
            self._begin_after_trial(now_us)

    def _on_answer(self, answer: Answer, now_us: int) -> None:
        request = self._requests.answered_by(answer)
        # It repeats the session of its request, which is none for a stop of an attached program.
        is_attached = isinstance(request, Stop) and request.session_id == NO_SESSION
        session_id = self.id if is_attached and not answer.session_id else answer.session_id
        if not self._is_ours(session_id, now_us):
            return
        if request is None:
            # The copy of a stop is acknowledged as well; nobody waits for that.
            self._foreign += answer.request_id != COPY_ID
            return
        # What the answer changes first: whoever asked goes on in another thread after that.
        if isinstance(request, ParameterTrial):
            self._trial.on_done(request, now_us)
        elif isinstance(answer, (ParameterValue, ParameterEntry)):
            self._take_value(answer.parameter, answer.value)
        elif isinstance(answer, ConfigurationValue) or isinstance(request, ConfigurationConfirm):
            self._take_board(answer)
        elif isinstance(request, SensorStream):
            size = None if self.board is None else self.board.peripheral_count
            self.sensors.note_asked(request.rate_hz, size, now_us)
        elif isinstance(request, (Stop, Estop)):
            self.setpoints.moves_until_us = 0
        elif isinstance(answer, Ack) and answer.message_id in _CLEARS:
            # Until the next state frame tells, assume that the device is no longer latched: else
            # the first setpoint after a clear would be refused here.
            self.setpoints.clear()
            if isinstance(request, ClearFault):
                self._latched = NO_FAULT  # the same fault may be latched before the next frame
        self._requests.on_answer(answer, now_us)

    def _take_value(self, parameter: int, value: float) -> None:
        self.values[parameter] = value
        if parameter in (REARM_GAP.id, TTL_MAX.id):
            self.setpoints.take_gap(parameter, value)
        if parameter in self._watched and self.phase is Phase.OPEN:
            self._collect_watched()

    def _take_board(self, answer: Answer) -> None:
        """Take the device's report of its board, or that it was confirmed."""
        if isinstance(answer, ConfigurationValue):
            with suppress(ValueError):
                self.board = ActiveBoard.from_value(answer)
        # The image's own board takes a restart, after which the device is asked anew.
        elif self.board is not None and self.board.state is ConfigurationState.TRIAL:
            self.board = replace(self.board, state=ConfigurationState.STORED)

    def _begin_after_trial(self, now_us: int) -> None:
        """Void all known values: the device has reverted a trial by itself."""
        expired = LinkLost(
            "a trial of parameters was not renewed in time; a new session is opened",
            causes=("trial_expired",),
        )
        self._begin_hello(expired, now_us)

    # --- who listens to the traffic --------------------------------------------------------------

    def listen(self, reader: TrafficReader, now_us: int) -> None:
        """Give `reader` the session's present state, and then all its inputs.

        This begins at once, or as soon as the session is prepared and knows the device's board.
        """
        self.traffic.host_us = now_us
        self._joining.append(reader)
        self._join()

    def leave(self, reader: TrafficReader) -> None:
        """Give `reader` nothing more; nothing at all, if it has not had the start yet."""
        self._joining = [one for one in self._joining if one is not reader]
        self.traffic.remove(reader)

    def _join(self) -> None:
        # What the session itself asks for is in no snapshot, nor what follows from its answer.
        while self._joining and self.phase is not Phase.PREPARING and not self._own_questions:
            self.traffic.add(self._joining.pop(), json.dumps(self._snapshot()).encode())

    def _snapshot(self) -> dict[str, Any]:
        """What `resume` needs. Counters start anew there, and open requests are left out."""
        snapshot: dict[str, Any] = {
            "phase": self.phase.name,
            "error": str(self.error),
            "nonce": self._nonce,
            "count": self.count,
            "stream_rate_hz": self._stream_rate_hz,
            "watched": self._watched,
            "settings": list(self._settings.items()),
            "any_board": self._any_board,
            "expected_board": self._expected_board,
            "hello": self._hello,
            "boots": self._boots.ids,
            "latched": self._latched,
            "held": self.setpoints.held,
            "hold": self.hold,
        }
        if self.phase is Phase.OPEN:
            liveness, stream = self._liveness, self._state_stream
            snapshot |= {
                "values": list(self.values.items()),
                "board": self.board and astuple(self.board),
                "copies_lost": self.copies_lost,
                "sensors": self.sensors.snapshot(),
                "clock": self._synchroniser.snapshot(),
                "liveness": [liveness.heard_us, liveness.state_us],
                "stream": stream.snapshot(),
                "requests": self._requests.snapshot(),
                "supervisor": self.setpoints.supervisor,
                "faults": self.setpoints.faults,
                "command_seq": _next_of(self._command_seqs),
            }
        return snapshot

    @classmethod
    def resumed(cls, snapshot: bytes, nonce: Callable[[], int]) -> Session:
        """A session that goes on from the state in a record START.

        Raises:
            ValueError: It is none of this release.
        """
        try:
            known = json.loads(snapshot)
            expected = known["expected_board"]
            session = cls(
                nonce,
                known["stream_rate_hz"],
                known["watched"],
                any_board=known["any_board"],
                settings=dict(known["settings"]),
                expected_board=None if expected is None else ExpectedBoard(*expected),
            )
            session.warn_held = lambda *_: None
            session._resume(known)
        except (KeyError, TypeError) as error:
            raise ValueError(f"it is the start of no session of this release: {error!r}") from error
        return session

    def _resume(self, known: dict[str, Any]) -> None:
        self.phase, self._nonce = Phase[known["phase"]], known["nonce"]
        self.error = LinkLost(known["error"])
        self._latched = Fault(known["latched"])
        self.setpoints.held = tuple(known["held"])
        for boot_id in known["boots"]:
            self._boots.enter(boot_id)
        if known["hello"] is None:
            return
        self._hello = hello = DeviceHello(*known["hello"])
        self.device, self.count = DeviceInfo.from_hello(hello), known["count"]
        if self.phase is not Phase.OPEN:
            return
        self.id, self._boot_id = self._nonce ^ hello.boot_id, hello.boot_id
        self.values = dict(known["values"])
        self.hold = None if known["hold"] is None else Hold(*known["hold"])
        if known["board"] is not None:
            board = ActiveBoard(*known["board"])
            self.board = replace(board, state=ConfigurationState(board.state))
        self.copies_lost = tuple(map(EventCode, known["copies_lost"]))
        self.sensors.resume(known["sensors"])
        self._synchroniser = Synchroniser.resumed(self.id, self._send, known["clock"])
        self._liveness.heard_us, self._liveness.state_us = known["liveness"]
        self._state_stream.resume(*known["stream"])
        self._requests.resume(known["requests"])
        if known["supervisor"] is not None:
            self.setpoints.supervisor = SupervisorState(known["supervisor"])
        self.setpoints.faults = Fault(known["faults"])
        self._command_seqs = count(known["command_seq"])
        self.setpoints.opened = OpenSession(
            self.id, self._synchroniser.clock, self._command_seqs, self._encoder
        )
        for gap in (REARM_GAP.id, TTL_MAX.id):
            if gap in self.values:
                self.setpoints.take_gap(gap, self.values[gap])
        self._collect_watched()

    # --- sending -------------------------------------------------------------------------------

    def _send(self, message: AnyMessage) -> None:
        self.output += self._encoder.encode(message)

    @property
    def _ping_due_us(self) -> int:
        synchroniser = self._synchroniser
        return min(synchroniser.due_us, self._liveness.ping_due_us(synchroniser.sent_us))


def _rolls_on(newest: Measurement, reported_mps: float) -> bool:
    """Whether a robot that was reported to roll still does."""
    fastest_mps = max(abs(newest.state.left_mps), abs(newest.state.right_mps))
    # Half, as the device does, which reports anew only after it was slower than that.
    return newest.supervisor is not SupervisorState.DRIVING and fastest_mps >= reported_mps / 2


def _next_of(numbers: count[int]) -> int:
    """The number that comes next, which stays there. Copies of a count end with Python 3.14."""
    return int(repr(numbers).removeprefix("count(").removesuffix(")"))
