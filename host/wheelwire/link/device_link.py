"""What every link to a device offers: one in real time, one in virtual time, a recording.

Also how it arms the robot when it is opened. A device that has started does not drive before a zero
setpoint or a pause. So a program that kept publishing during the restart does not move it. A
program that opens a link has not published yet, so this module sends the zero for it. A link that
reconnects by itself never sends it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from os import sched_yield
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from wheelwire_protocol.codes import RefusalCode, StopMode
from wheelwire_protocol.types import Hold, SetDuty, SetWheelVelocity

from ..errors import (
    DeviceRefused,
    Expired,
    InvalidCommand,
    LinkClosed,
    LinkLost,
    RequestTimeout,
    WheelwireError,
    afresh,
)
from ..samples import Setpoint
from .clock import host_clock_us
from .holds import HeldBy, LastStop
from .info import DeviceInfo, LinkInfo
from .requests import REPEAT_US, Answer, Done, RequestMessage
from .sample_stream import DUTY_SCALE
from .session import Phase, Session
from .setpoints import SetpointPort, SetpointSender
from .traffic import Reporter, Traffic, TrafficReader

if TYPE_CHECKING:
    from .device_reports import DeviceReports
    from .sensor_stream import SensorStream
    from .statistics import LinkStatistics

Opening: TypeAlias = "Iterator[tuple[Callable[[], bool], float]]"
"""The conditions that a caller waits for while a link opens, one after the other, each with its
time limit [s]."""

CALL_TIMEOUT_S = 5.0
"""A request times out after about one second, and others may be queued before it."""


class DeviceLink(Reporter, ABC):
    """A link to one device. Its user opens it first, and closes it.

    The caller that lets time pass calls a listener.
    """

    in_virtual_time: bool = False
    """Whether time passes only in its `advance`."""
    arms: bool = False
    """Whether opening it sends a zero setpoint, so that the robot obeys the program's first one.
    A link that drives nothing, such as a recording, sends none."""
    reported: DeviceReports
    """What the device has reported."""
    drive_velocity: Callable[[float, float, int], None]
    """Writes one setpoint at once: the wheels' velocities [m/s], and when it expires on the host's
    clock [us]. It and `drive_duty` lead to the sender of the setpoints without a call between."""
    drive_duty: Callable[[float, float, int], None]
    """The same for duties, -1..1."""

    # --- opening and closing -------------------------------------------------------------------

    @abstractmethod
    def open(self) -> None:
        """Open it, and wait for a session."""

    @abstractmethod
    def close(self) -> None:
        """Stop the robot and end the link. Safe to call more than once."""

    @property
    @abstractmethod
    def _end(self) -> WheelwireError | None:
        """Why the link is down for good; None while it is not."""

    @property
    def has_ended(self) -> bool:
        """Whether the link is down for good."""
        return self._end is not None

    def check(self) -> None:
        """Raise why the link is not open, if it is not."""
        self._check_alive()
        self._session.check_open()

    def _check_alive(self) -> None:
        if self._end is not None:
            raise afresh(self._end)

    # --- what is known ---------------------------------------------------------------------------

    @property
    @abstractmethod
    def name(self) -> str:
        """Name for messages."""

    @property
    @abstractmethod
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""

    @property
    @abstractmethod
    def statistics(self) -> LinkStatistics:
        """What was counted since the link was opened."""

    @property
    def _device(self) -> DeviceInfo:
        if self._session.device is None:
            raise afresh(self._session.error)
        return self._session.device

    @property
    def sessions(self) -> int:
        """Number of sessions since the link was opened."""
        return self._session.count

    @property
    def rolling_mps(self) -> float | None:
        """As `Session.rolling_mps`."""
        return self.reported.rolling_mps

    @property
    def session_id(self) -> int:
        """As `Session.id`."""
        return self._session.id

    @property
    def hold(self) -> Hold | None:
        """As `Session.hold`."""
        return self.reported.hold

    def held_by(self, hold: Hold) -> HeldBy:
        """As `Session.held_by`."""
        return self.reported.held_by(hold)

    def last_stop(self, hold: Hold) -> LastStop:
        """As `Session.last_stop`, with the program that drove."""
        stop = self._session.last_stop(hold)
        if not stop.session_id:
            return stop
        from .sharing_folder import driver_of  # here, for most programs never ask

        return stop._replace(program=driver_of(self._device.board_id, stop.session_id))

    @property
    def sensors(self) -> SensorStream:
        """What the sensors measure; another object after an attached link took the session over."""
        return self._session.sensors

    @property
    def knows_device(self) -> bool:
        """As `Session.knows_device`."""
        return self._session.knows_device

    @property
    def knows_list(self) -> bool:
        """Whether the device has said how many channels it has."""
        return self.reported.board is not None

    @property
    def knows_sensors(self) -> bool:
        """Whether samples were asked for, and each channel has said what it is."""
        board = self.reported.board
        return self.sensors.is_complete(None if board is None else board.peripheral_count)

    def why_no_sensors(self, waited_s: float) -> WheelwireError:
        """The error of a caller to whom the device did not say which sensors it has."""
        self.check()
        return RequestTimeout(
            f"{self.name} did not say within {waited_s:g} s which sensors it has: check the link's "
            "statistics"
        )

    def asked(self, now_us: int) -> Setpoint | None:
        """The driving program's newest setpoint; None once it has expired or was stopped."""
        newest = self._session.setpoints.newest  # once: another thread may replace it
        if newest is None or newest[1] <= now_us:
            return None
        asked = newest[0]
        if isinstance(asked, SetDuty):
            left, right = asked.left_duty_q15, asked.right_duty_q15
            return Setpoint(left / DUTY_SCALE, right / DUTY_SCALE, duty=True)
        return Setpoint(asked.left_mps, asked.right_mps, duty=False)

    @property
    def watched_values(self) -> Mapping[int, float]:
        """The newest values of the watched parameters, by id: the same object until one changes."""
        values = self.reported.watched_values
        # The end of a link ends the session as well, so there is nothing else to look at.
        if values is None:
            self._check_alive()
            raise afresh(self._session.error)
        return values

    def known(self, parameter: int) -> float | None:
        """The newest value of a parameter that was reported in this session, if there is one."""
        self.check()
        return self.reported.values.get(parameter)

    # --- what is asked for -----------------------------------------------------------------------

    def _drive_through(self, port: SetpointPort) -> None:
        """Have setpoints written to `port`."""
        setpoints = self._session.setpoints
        setpoints.port = port
        self.drive_velocity = partial(setpoints.drive, SetWheelVelocity)
        self.drive_duty = partial(setpoints.drive, SetDuty)

    def settle(self) -> None:
        """A setpoint could not be sent: where a thread serves the port, wait for what it knows.

        Raises:
            LinkLost: The reason, if it is another one.
        """

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer.

        Raises:
            DeviceRefused: The device refused it.
            LinkLost: The link is down, or went down before the answer came.
            RequestTimeout: No answer came.
        """
        return cast("Answer", self._result(partial(self.post, message), is_stop=False))

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop and wait for the acknowledgement. The stop is sent even without a session.

        Raises:
            LinkLost: There is no session: whether the stop arrived is unknown.
            RequestTimeout: No acknowledgement came.
        """
        self._result(partial(self.post_stop, mode=mode))

    def estop(self) -> None:
        """Stop, latch and wait for the acknowledgement; otherwise as `stop`."""
        self._result(partial(self.post_stop, mode=None))

    @abstractmethod
    def post(self, message: RequestMessage, done: Done) -> None:
        """As `request`, without waiting: `done` is called with the result."""

    @abstractmethod
    def post_stop(self, done: Done, mode: StopMode | None = StopMode.CONFIGURED) -> None:
        """As `stop`, or with None `estop`, without waiting: `done` is called with the result."""

    @abstractmethod
    def withdraw(self, done: Done) -> None:
        """The caller of a request has given up: the link sends no copy of it from now on."""

    def _result(self, post: Callable[[Done], None], *, is_stop: bool = True) -> Any:
        """Wait for the result of what `post` asks for; return it, or raise its error.

        A call whose time is up is withdrawn, so that no copy goes out after its caller has gone on.
        A request is withdrawn, too, when an exception out of a signal handler ends the wait; a stop
        has to arrive in any case.
        """
        # A queue for each call: a result that comes after its caller gave up is dropped.
        results: SimpleQueue[Any] = SimpleQueue()

        def done(result: object) -> None:
            results.put(result)
            # Or the caller wakes while this thread has the interpreter, and has to sleep again.
            sched_yield()

        try:
            post(done)
            try:
                result = results.get(timeout=REPEAT_US / 1e6)
            except Empty:
                self._remind()
                result = results.get(timeout=CALL_TIMEOUT_S)
        except Empty:
            self.withdraw(done)
            raise self.no_answer() from None
        except BaseException:
            if not is_stop:
                self.withdraw(done)
            raise
        if isinstance(result, WheelwireError):  # the same may end many calls
            raise afresh(result)
        return result

    def _remind(self) -> None:
        """The result of a call takes longer than usual."""

    def refused_rate(self, rate_hz: int, error: InvalidCommand) -> InvalidCommand:  # noqa: ARG002
        """The error of a program that may not ask for its sensors' samples at this rate."""
        return error

    def no_answer(self) -> RequestTimeout:
        """The error of a call that has had no result within `CALL_TIMEOUT_S`."""
        return RequestTimeout(
            f"the link did not answer for {CALL_TIMEOUT_S:g} s: it is unknown whether that was"
            " done; check the port, and what keeps this computer busy"
        )

    def release_trial(self) -> None:
        """The application has left its trial of parameters."""
        self._session.release_trial()

    # --- what is passed on -----------------------------------------------------------------------

    @property
    def traffic(self) -> Traffic:
        """Passes on what crosses the link."""
        return self._session.traffic

    @abstractmethod
    def listen_to_traffic(self, reader: TrafficReader) -> None:
        """Give `reader` all that crosses the link from now on."""

    def note(self, what: Mapping[str, Any]) -> None:
        """Pass on something that the program says to all that listen."""
        self.traffic.note(what, self.clock_us())

    # --- time ------------------------------------------------------------------------------------

    def advance(self, seconds: float) -> None:  # noqa: ARG002 - virtual time has a use for it
        """Let virtual time pass.

        Raises:
            InvalidCommand: Time is real.
        """
        raise InvalidCommand(
            "time passes by itself: give realtime=False, or a replay speed=0, to advance it"
        )

    def clock_us(self) -> int:
        """The time of the link, which is virtual or the computer's."""
        return host_clock_us()


# --- a link without a port, whose callers let its time pass ---------------------------------------

STEP_S = 0.001
"""By how much time passes between two looks."""
ANSWER_S = 5.0


class InlineLink(DeviceLink):
    """A link whose callers do what the port's thread does for a `Link`."""

    @property
    def info(self) -> LinkInfo:
        """The name and the device."""
        told = self.reported
        return LinkInfo(self.name, None, None, self._device, told.board, told.copies_lost)

    @property
    @abstractmethod
    def now_us(self) -> int:
        """The time of the link."""

    def wait_for(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass until `ready()`, or for `timeout_s`; returns whether it was ready."""
        end_us = self.now_us + round(timeout_s * 1e6)
        while not ready():
            if self.now_us >= end_us:
                return False
            self._pass(end_us - self.now_us)
        return True

    def _pass(self, most_us: int) -> None:  # noqa: ARG002 - it looks more often
        """Let time pass until something may have changed, but at most this long."""
        self.advance(STEP_S)

    def clock_us(self) -> int:
        """As `now_us`."""
        return self.now_us

    def _result(self, post: Callable[[Done], None], *, is_stop: bool = True) -> Any:  # noqa: ARG002 - nothing can interrupt it
        results: list[Answer | WheelwireError] = []
        done = results.append
        post(done)
        if not self.wait_for(lambda: bool(results), ANSWER_S):
            self.withdraw(done)
            raise RequestTimeout(f"{self.name} does not answer; is it unplugged?")
        if isinstance(results[0], WheelwireError):
            raise afresh(results[0])
        return results[0]


# --- the zero setpoint that comes before all others -----------------------------------------------

ZERO_TTL_US = 250_000
"""More than the error bound of the clock; the stop behind the zero ends it at once."""
SEEN_S = 0.25
"""How long a state frame or a refusal may take to show what became of the zero."""
LOST_ATTEMPTS = 5
BOOTING_ATTEMPTS = 50
BOOTING_PAUSE_S = 0.02
"""Between two attempts while the sensors of a device that was just started are read first."""


def arming(link: DeviceLink, session: Session) -> Opening:
    """Send zero setpoints, each followed by a stop, until the device has obeyed or refused one.

    The stop leaves the robot in IDLE, as it was: in DRIVING a device refuses to change parameters.
    A refusal, as on an unconfirmed board, does not fail the opening: the program's own first
    setpoint is refused for the same reason.

    Args:
        link: It was opened.
        session: Its session.
    """
    setpoints = session.setpoints
    lost = booting = 0
    while lost < LOST_ATTEMPTS and booting < BOOTING_ATTEMPTS and session.phase is Phase.OPEN:
        results: list[Answer | WheelwireError] = []
        setpoints.awaits_fate = True
        try:
            link.drive_velocity(0.0, 0.0, link.clock_us() + ZERO_TTL_US)
            zero_seq = setpoints.zero_seq
            link.post_stop(results.append)
        except (DeviceRefused, Expired, LinkClosed, LinkLost):
            break
        yield partial(_is_decided, results, setpoints, zero_seq), SEEN_S
        refusal = setpoints.refusal_of(zero_seq)
        if refusal is not None:
            yield from _forget_refusal(link)
        if not setpoints.has_fate(zero_seq):
            lost += 1
        elif refusal != RefusalCode.BOOTING:
            # A lost stop is repeated. Until it is obeyed, the zero drives.
            yield partial(bool, results), ZERO_TTL_US / 1e6
            break
        else:
            booting += 1
            yield bool, BOOTING_PAUSE_S
    setpoints.awaits_fate = False


def _forget_refusal(link: DeviceLink) -> Opening:
    """Stop again, or the first setpoint of the program would raise this refusal."""
    results: list[Answer | WheelwireError] = []
    with suppress(LinkClosed, LinkLost):
        link.post_stop(results.append)
        yield partial(bool, results), SEEN_S


def _is_decided(results: list[Answer | WheelwireError], zeros: SetpointSender, seq: int) -> bool:
    """Whether the stop was answered, and the device has said what it did with the zero before."""
    return bool(results) and zeros.has_fate(seq)
