"""One host's session with one device: hello, preparation, and dispatch of messages.

    CLOSED -> HELLO -> PREPARING -> OPEN      and from any of them back to HELLO or CLOSED

Hello is repeated until the device answers. Then the clock is synchronised, and `Preparation` asks
for what the session needs to be open. It ends when the port closes, when the device falls silent or
is reset, and when the device no longer knows the session. `DeviceReports` keeps what the device
says of itself meanwhile.

All inputs that decide what it does are passed on first, so that it can be run again
(`traffic.Kind`).

Sans-IO: bytes and times in; bytes, samples and the next deadline out, so that it runs in virtual
time as well. All times are microseconds of one monotonic host clock. One thread owns a session;
any other may ask for a setpoint's frame at any time, to write it itself. That needs no lock: it
uses only one object of the session, which is replaced as a whole.
"""

from __future__ import annotations

import enum
import os
import struct
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

from wheelwire_protocol import types as wire
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.codes import EventCode, RefusalCode, StopMode, TrialAction
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder, encode_frame
from wheelwire_protocol.types import ANSWERS, AnyMessage, WheelState

from ..errors import NO_FAULT, DeviceRefused, LinkLost, WheelwireError, WrongBoard, afresh
from . import LINK_LOG, LOG
from .clock import Liveness, Synchroniser
from .device_reports import DeviceReports
from .holds import LastStop
from .info import (
    BootHistory,
    DeviceInfo,
    ExpectedBoard,
    RecentCounts,
    RoundTrips,
    device_of_session,
)
from .preparation import Preparation
from .requests import (
    COPY_ID,
    Answer,
    Done,
    HeldTrial,
    Request,
    RequestMessage,
    RequestQueue,
    subject,
)
from .sample_stream import Measurement, StateStream
from .setpoints import SETPOINT_IDS, OpenSession, SetpointSender
from .traffic import (
    ATTACHED,
    ESTOP,
    Happening,
    Kind,
    Notice,
    StandingNotice,
    Traffic,
    TrafficReader,
)

if TYPE_CHECKING:
    from .plain_text import PlainText
    from .sensor_stream import SensorMessage, SensorStream
    from .statistics import LinkStatistics

NO_SESSION = 0
"""The id in a message that belongs to no session."""
HELLO_PERIOD_US = 30_000
RETRY_US = 1_000_000
"""Until the next hello after the device opened a session but refused to be prepared."""

_CHANGES = (wire.ParameterSet, wire.ParameterSave, wire.ParameterReset, wire.ParameterTrial)
"""Requests that an application sends for the values that are on trial."""
_CONSEQUENTIAL = (wire.ParameterTrial, wire.ClearEstop, wire.ClearFault)
"""Requests that change what the session knows before they are answered."""
_SENSED = (wire.Imu, wire.Power, wire.Range, wire.Inputs, wire.SensorEvent)


def random_nonce() -> int:
    """32 random bits.

    Not from `random`: a program that seeds it would draw the nonces of its last run again, and the
    device would take its session for the one that is open.
    """
    return int.from_bytes(os.urandom(4), "little")


class Phase(enum.Enum):
    """Phase of the session."""

    CLOSED = enum.auto()
    """No port."""
    HELLO = enum.auto()
    """Hello is repeated until answered."""
    PREPARING = enum.auto()
    """The clock is being synchronised, stream rate and parameters are being set."""
    OPEN = enum.auto()


_IN_SESSION = (Phase.PREPARING, Phase.OPEN)


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
        phase: Phase of the session.
        id: Its id on the wire; 0 outside one.
        error: Why the session is not open; meaningless while it is.
        device: The device of the newest session.
        count: Number of sessions so far.
        answers: Number of answers to hellos, whether a session was opened or not.
        unanswered_since_us: Since when hellos have gone unanswered; None during a session or
            without a port.
        reported: What the device has reported, such as its board.
        bytes_received: Since the start.
        frames_received: Good frames of known messages, since the start.
        setpoints: Makes the frames of setpoints, for any thread.
        output: Bytes that `take_output` would return.
        notices: What has happened, in order; the thread that serves the session removes it.
        traffic: Passes on what this session is given.
        warn: Takes what the user should know, as `logging.warning` does.
        warn_held: The same for setpoints that are held; silent in a copy that follows a session.
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
        self.error: WheelwireError = LinkLost("the port was not opened yet")
        self.device: DeviceInfo | None = None
        self.count = 0
        self.answers = 0
        self.unanswered_since_us: int | None = None
        self.bytes_received = 0
        self._plain_text: PlainText | None = None
        self.frames_received = 0
        self.notices: deque[Notice] = deque()
        self.traffic = Traffic()
        self.warn: Callable[..., None] = LOG.warning
        self.warn_held: Callable[..., None] = LINK_LOG.warning

        self._joining: list[TrafficReader] = []
        """The readers that listen as soon as the session is prepared."""
        self._draw_nonce = nonce
        self._any_board = any_board

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

        self._nonce = 0
        self._hello_due_us = 0
        self._boot_id: int | None = None
        """The device's boot id; None outside a session."""
        self._hello: wire.DeviceHello | None = None
        """What began the newest session."""
        self._command_seqs = count(1)
        self._boots = BootHistory()
        self._liveness = Liveness(0)

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
        self.reported = DeviceReports(
            watched, self.setpoints, self.notices, lambda *words: self.warn(*words)
        )
        self._state_stream = StateStream()
        self._preparation = Preparation(
            self._requests, self.reported, settings or {}, stream_rate_hz, expected_board
        )
        # It belongs to no session: `statistics` may be asked for before the first one.
        self._synchroniser = Synchroniser(0, self._send, 0)
        self._handlers: dict[type[AnyMessage], Callable[..., object]] = {
            # `receive` collects those of this boot itself.
            WheelState: lambda state, now_us: self._is_this_boot(state.boot_id, now_us),
            wire.DeviceHello: self._on_hello,
            wire.Pong: self._on_pong,
            wire.Event: self._on_event,
            wire.Refuse: self._on_refuse,
            **dict.fromkeys((wire.Ack, *ANSWERS.values()), self._on_answer),
            wire.Hold: self._on_hold,
            wire.SensorInfo: self._on_sensor_info,
            **dict.fromkeys(_SENSED, self._on_sensed),
        }
        # What the answer to a request changes here, by the request.
        self._applied: dict[type[RequestMessage], Callable[[Any, Any, int], None]] = {
            wire.ParameterTrial: lambda asked, _, now_us: self._trial.on_done(asked, now_us),
            **dict.fromkeys(
                (wire.ParameterGet, wire.ParameterSet, wire.ParameterList),
                lambda _, answer, __: self.reported.take_value(answer.parameter, answer.value),
            ),
            **dict.fromkeys(
                (wire.ConfigurationGet, wire.ConfigurationConfirm),
                lambda _, answer, __: self.reported.take_board(answer),
            ),
            wire.SensorStream: self._apply_stream,
            **dict.fromkeys((wire.Stop, wire.Estop), self._apply_stop),
            **dict.fromkeys((wire.ClearEstop, wire.ClearFault), self._apply_clear),
        }

    @property
    def plain_text(self) -> PlainText:
        """Text that came in place of frames since the device last answered."""
        if self._plain_text is None:
            from .plain_text import PlainText  # here, for most devices answer at once

            self._plain_text = PlainText()
        return self._plain_text

    @property
    def sensors(self) -> SensorStream:
        """What the sensors measure."""
        return self.reported.sensors

    def statistics(self, now_us: int, reconnects: int = 0) -> LinkStatistics:
        """A snapshot of all counters."""
        from .statistics import statistics_of  # here, for many programs never ask

        return statistics_of(self, now_us, reconnects)

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
        """Process any bytes; returns the new measurements.

        Of state frames that arrive together, that is the newest, or with `every_state` each.
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
            self._handlers.get(type(message), self._on_echo)(message, now_us)
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

    def _text_in(self, data: bytes) -> list[AnyMessage]:
        """Read the text of a chip that does not run and may say why; no message is in it."""
        if self.phase is Phase.HELLO and (text := self.plain_text).feed(data):
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
            sensors = self.reported.sensors_if_asked
            if sensors is not None and sensors.due_us is not None and now_us >= sensors.due_us:
                self._preparation.ask_for_sensors(sensors, self.id, now_us)
            renewal = self._trial.renewal(now_us)
            if renewal is not None:
                renewal = renewal._replace(session_id=self.id)
                # Whatever the answer: a refusal because there is no trial ends the session.
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
        sensors = self.reported.sensors_if_asked
        others = (
            self._requests.next_deadline_us,
            self.setpoints.repeat_due_us,
            self._trial.due_us,
            None if sensors is None else sensors.due_us,
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
        return self.phase is Phase.OPEN and not self._preparation.questions

    def stop(self, mode: StopMode | None, done: Done, now_us: int) -> None:
        """Void the setpoint and stop, with None latch. Without a session it is not acknowledged."""
        self.traffic.put(Kind.STOP, now_us, bytes([ESTOP if mode is None else mode]))
        message: wire.Stop | wire.Estop
        if mode is None:
            message = wire.Estop(self.id, 0)
        else:
            # Numbered from the setpoints' counter, so that those still on their way are void.
            message = wire.Stop(self.id, 0, next(self._command_seqs), mode)
        # First, so that no repeat of an earlier setpoint goes out behind the stop.
        self.setpoints.on_stop()
        self._send_stop(message, done, now_us)

    def stop_for_attached(self, done: Done, now_us: int) -> None:
        """Stop in the configured mode, for an attached program, outside any session.

        So it does not replace a stronger stop of the session, nor use up a setpoint's number.
        """
        self.traffic.put(Kind.STOP, now_us, bytes([ATTACHED]))
        message = wire.Stop(NO_SESSION, 0, 0, StopMode.CONFIGURED)
        self.setpoints.void()  # what was sent before it is not to be repeated behind it
        self._send_stop(message, done, now_us)

    def _send_stop(self, message: wire.Stop | wire.Estop, done: Done, now_us: int) -> None:
        if self.phase is Phase.OPEN:
            self._requests.submit(message, done, now_us)
            return
        # The device obeys a stop from any sender, so it is sent even without a session. Then no
        # answer shows whether it arrived.
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
        reverts = isinstance(message, wire.ParameterTrial) and message.action == TrialAction.REVERT
        if isinstance(message, _CHANGES) and not reverts:
            self._trial.check(subject(message))
        if isinstance(message, wire.ParameterTrial):
            self._trial.on_request(message)
        if reverts or isinstance(message, (wire.ClearEstop, wire.ClearFault)):
            self.setpoints.void()  # only what is commanded from now on may move the wheels
        self._requests.submit(message._replace(session_id=self.id), done, now_us)

    def claim_request(self, message: RequestMessage, done: Done, now_us: int) -> Request | None:
        """Begin a request in the calling thread, which is any.

        Returns:
            The request, with a frame to be written at once, or without one if the port's thread
            has to go on with it by `request_claimed`. None if `request` has to be called there:
            something else comes first, or it changes what is known here.
        """
        opened = self.setpoints.opened
        if opened is None or self._trial.held is not None or self.traffic.readers:
            return None
        if isinstance(message, _CONSEQUENTIAL):
            return None
        claimed = self._requests.claim(message, done, now_us)
        # Checked again now that the line is claimed. From here on, a new reader sees the request,
        # and so does the end of the session.
        if claimed is not None and self.setpoints.opened is opened and not self.traffic.readers:
            self._requests.begin(claimed, opened.id)
            claimed.frame = opened.encoder.encode(claimed.message)
        return claimed

    def request_claimed(self, claimed: Request, done: Done, now_us: int) -> None:
        """Send a request that its caller has claimed, and not begun; otherwise as `request`."""
        if self._requests.release_claimed(claimed):
            self.request(claimed.message, done, now_us)

    @property
    def is_asked(self) -> bool:
        """Whether a request is on the line, or about to be."""
        return self._requests.is_open

    def release_trial(self) -> None:
        """The application has left its trial of parameters; from any thread."""
        self.traffic.put(Kind.RELEASED, self.traffic.host_us)
        self._trial.release()

    def standing_notice(self, happening: Happening) -> StandingNotice | None:
        """What to tell a new listener of the present state; None if there is nothing."""
        if happening is Happening.LOST and self.phase is not Phase.OPEN:
            return StandingNotice(happening, afresh(self.error))
        return self.reported.standing_notice(happening)

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
        return self.phase in _IN_SESSION

    def _begin_hello(self, error: WheelwireError, now_us: int, pause_us: int = 0) -> None:
        """End the current session and, after a pause, say hello with a new nonce."""
        self._end(error)
        self.phase = Phase.HELLO
        # Nothing is sent during the pause, so it does not count as silence of the device.
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
            self._send(wire.Hello(self._nonce, PROTOCOL_VERSION, schema_hash()))

    def _end(self, error: WheelwireError) -> None:
        self.error = error  # first: other threads read it as soon as they see the phase
        if self.phase is Phase.OPEN:
            self.notices.append((Happening.LOST, afresh(error)))
        self.phase = Phase.CLOSED
        self.reported.end_session()
        self.setpoints.end_session()
        self.id, self._boot_id = 0, None
        self.unanswered_since_us = None
        self._trial.lose()  # first: a caller that learns of the end may drive again at once
        self._requests.abort(error)

    def _on_hello(self, hello: wire.DeviceHello, now_us: int) -> None:
        """Handle an answer to a hello, which may begin a session."""
        if hello.nonce != self._nonce:
            self._foreign += 1
            return
        self.answers += 1
        self._plain_text = None
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
        restarted = self.count > 0 and self._boots.is_new(device.boot_id)
        if restarted:
            self.setpoints.hold(now_us)
        self._boots.enter(device.boot_id)
        another = self.device is None or self.device.board_id != device.board_id
        self.reported.begin_session(restarted=restarted, another=another)
        self.device = device
        self.phase = Phase.PREPARING
        self.unanswered_since_us = None
        self.count += 1
        self.id, self._boot_id = self._nonce ^ device.boot_id, device.boot_id
        self._liveness = Liveness(now_us)
        # The device may have been reset, which sets its frame numbers back: nothing was lost.
        self._decoder.restart_sequence()
        self._requests.begin_session()
        # Again: a thread that was making a frame when the previous session ended may have queued it
        # for a repeat since.
        self.setpoints.clear()
        self.setpoints.moves_until_us = 0  # a new session voids the setpoint of the one before
        self._command_seqs = count(1)
        # Requests and pings go out together: whichever takes longer decides when it is open.
        self._synchroniser = Synchroniser(self.id, self._send, now_us)
        self._synchroniser.ping(now_us)
        self._preparation.begin(self.id, device, now_us)

    def _open_when_prepared(self, now_us: int) -> None:
        """Open the session once it is prepared; start over if preparing it failed."""
        preparation = self._preparation
        failure = preparation.failure
        if failure is not None:
            # A refusal would be repeated at once, and for ever; a lost answer may come next time.
            pause_us = RETRY_US if isinstance(failure, DeviceRefused) else 0
            self._begin_hello(failure, now_us, pause_us)
        elif preparation.is_complete and self._synchroniser.ready:
            mismatch = self.reported.board_mismatch(preparation.expected_board)
            if mismatch is not None:
                # Hellos go on: the board may be written while the program waits.
                self._begin_hello(mismatch, now_us, RETRY_US)
                return
            # The phase last: a thread that sees it may send a setpoint at once.
            self.reported.collect_watched()
            opened = OpenSession(
                self.id, self._synchroniser.clock, self._command_seqs, self._encoder
            )
            self.setpoints.open(opened, now_us)
            self.phase = Phase.OPEN
            self.notices.append((Happening.OPENED, self.device))
            self.reported.tell_held()
            self._join()

    # --- what the device says ------------------------------------------------------------------

    def _is_ours(self, session_id: int, now_us: int) -> bool:
        """Whether a message belongs to this session. If so, the device counts as heard."""
        ours = self.phase in _IN_SESSION and session_id == self.id
        # Messages of an earlier session do not show that this one is alive.
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
                reported = self.reported
                if reported.rolling_mps is not None:
                    reported.end_rolling(newest, reported.rolling_mps)
                self.setpoints.supervisor = newest.supervisor
                self.setpoints.faults = newest.faults
                if newest.faults != reported.latched:
                    reported.note_latched(newest.faults)
                self.setpoints.on_obeyed(newest.state.command_seq, now_us)
        states.clear()

    def _on_echo(self, _: AnyMessage, _now_us: int) -> None:
        """A message that only hosts send."""
        self._foreign += 1

    def _on_pong(self, pong: wire.Pong, now_us: int) -> None:
        if not self._is_ours(pong.session_id, now_us):
            return
        exchange = self._synchroniser.on_pong(pong, now_us)
        if exchange is None:
            self._foreign += 1
        else:
            self._round_trips.add(exchange.round_trip_us)

    def _on_event(self, event: wire.Event, now_us: int) -> None:
        if not self._is_this_boot(event.boot_id, now_us):
            return
        if event.code == EventCode.TRIAL_EXPIRED:
            self._begin_after_trial(now_us)
            return
        try:
            self.reported.take_event(event)
        except ValueError:
            self._invalid += 1

    def last_stop(self, hold: wire.Hold) -> LastStop:
        """What ended the robot's last motion, by what the device said. From any thread."""
        clock, stamp = self._synchroniser.clock, None
        if hold.stop_us and clock.synchronised:
            stamp = clock.conversion.device_to_host(hold.stop_us)[0] / 1e6
        return LastStop.of(hold, stamp)

    def _on_hold(self, hold: wire.Hold, now_us: int) -> None:
        """Take what holds the robot: an answer, or what the device says by itself."""
        if self._in_session and hold.session_id == self.id:
            try:
                self.reported.take_hold(hold)
            except ValueError:
                self._invalid += 1
            else:
                if self.phase is Phase.OPEN:
                    self.reported.tell_held()
        if hold.request_id:
            self._on_answer(hold, now_us)
        else:
            self._is_ours(hold.session_id, now_us)

    def _on_sensor_info(self, info: wire.SensorInfo, now_us: int) -> None:
        if self._is_ours(info.session_id, now_us):
            try:
                self.sensors.take_info(info)
            except ValueError:
                self._invalid += 1

    def _on_sensed(self, message: SensorMessage, now_us: int) -> None:
        """Take a sample or an event of a sensor; before the session is open it has no stamp."""
        if self._is_this_boot(message.boot_id, now_us) and self.phase is Phase.OPEN:
            try:
                self.sensors.take(message, self._synchroniser.clock, now_us)
            except ValueError:
                self._invalid += 1

    def _on_refuse(self, refuse: wire.Refuse, now_us: int) -> None:
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
        asked = self._requests.answered_by(answer)
        request = None if asked is None else asked.message
        # An answer repeats the session id of its request. An attached program's stop has none.
        is_attached = isinstance(request, wire.Stop) and request.session_id == NO_SESSION
        session_id = self.id if is_attached and not answer.session_id else answer.session_id
        if not self._is_ours(session_id, now_us):
            return
        if asked is None:
            # The copy of a stop is acknowledged, too, but no request waits for that.
            self._foreign += answer.request_id != COPY_ID
            return
        # First apply what the answer changes: then the caller goes on, in another thread.
        apply = self._applied.get(type(asked.message))
        if apply is not None:
            apply(asked.message, answer, now_us)
        self._requests.finish(asked, answer, now_us)

    def _apply_stream(self, request: wire.SensorStream, _: Answer, now_us: int) -> None:
        board = self.reported.board
        size = None if board is None else board.peripheral_count
        self.sensors.note_asked(request.rate_hz, size, now_us)

    def _apply_stop(self, _: wire.Stop | wire.Estop, __: Answer, _now_us: int) -> None:
        self.setpoints.moves_until_us = 0

    def _apply_clear(self, request: RequestMessage, _: Answer, _now_us: int) -> None:
        # Until the next state frame tells, assume that the device is no longer latched: else the
        # first setpoint after a clear would be refused here.
        self.setpoints.clear()
        if isinstance(request, wire.ClearFault):
            # The same fault may be latched before the next frame.
            self.reported.latched = NO_FAULT

    def _begin_after_trial(self, now_us: int) -> None:
        """Void all known values: the device has reverted a trial by itself."""
        expired = LinkLost(
            "a trial of parameters was not renewed in time; a new session is opened",
            causes=("trial_expired",),
        )
        self._begin_hello(expired, now_us)

    # --- readers of the traffic ------------------------------------------------------------------

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
        # A snapshot has neither the session's own requests nor what follows from their answers.
        asks = self.phase is Phase.PREPARING or self._preparation.questions
        while self._joining and not asks:
            from .handover import hand_over  # here, for most sessions have no reader

            hand_over(self, self._joining.pop())

    # --- sending -------------------------------------------------------------------------------

    def _send(self, message: AnyMessage) -> None:
        self.output += self._encoder.encode(message)

    @property
    def _ping_due_us(self) -> int:
        synchroniser = self._synchroniser
        return min(synchroniser.due_us, self._liveness.ping_due_us(synchroniser.sent_us))
