"""What the device has reported in this session: values, board, what holds it, what it noticed."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from wheelwire_protocol.codes import ConfigurationState, EventCode, Fault, Held, SupervisorState
from wheelwire_protocol.types import ConfigurationValue, Event, Hold

from ..errors import NO_FAULT, BoardMismatch
from .holds import UNARMED, HeldBy, LastStop
from .info import ActiveBoard, ExpectedBoard
from .requests import Answer
from .sample_stream import Measurement
from .setpoints import REARM_GAP, TTL_MAX, SetpointSender
from .traffic import Happening, Notice, StandingNotice

if TYPE_CHECKING:
    from .sensor_stream import SensorStream

_COPIES = (
    EventCode.CONFIGURATION_COPY_LOST,
    EventCode.PARAMETERS_COPY_LOST,
    EventCode.LATCHES_COPY_LOST,
)


class DeviceReports:
    """What the device has reported. The session's thread changes it; any may read the attributes.

    Args:
        watched: Ids of parameters whose values are read whenever a session opens.
        setpoints: Take the supervisor's state and the gaps.
        notices: Where to put what has happened.
        warn: Takes what the user should know, as `logging.warning` does.

    Attributes:
        values: Parameter id -> the newest value reported by the device in this session.
        watched_values: Parameter id -> value of the watched parameters; None while no session is
            open. Replaced as a whole when one of them changes.
        board: What this session knows of the device's board; None if the device cannot say.
        copies_lost: The stored blocks of which the device found only one of two copies when it
            started.
        rolling_mps: How fast the undriven robot rolled, as the device reported; None without a
            report, and once it slows down or drives.
        hold: The device's last report of what holds it and of its last stop; None before the first.
        latched: Faults that the device has reported to be latched. They outlast sessions and
            resets.
        sensors_if_asked: `sensors`; None before that was asked for.
    """

    def __init__(
        self,
        watched: Sequence[int],
        setpoints: SetpointSender,
        notices: deque[Notice],
        warn: Callable[..., None],
    ) -> None:
        self.watched = tuple(watched)
        self.values: dict[int, float] = {}
        self.watched_values: Mapping[int, float] | None = None
        self.board: ActiveBoard | None = None
        self.copies_lost: tuple[EventCode, ...] = ()
        self.rolling_mps: float | None = None
        self.hold: Hold | None = None
        self.latched = NO_FAULT
        self.sensors_if_asked: SensorStream | None = None
        self._setpoints = setpoints
        self._notices = notices
        self._warn = warn
        self._making = threading.Lock()
        self._told_held = HeldBy()
        """What was last reported to the listener; outlasts sessions, too."""

    def begin_session(self, *, restarted: bool, another: bool) -> None:
        """A session begins; the device has `restarted` since the last, or is `another`."""
        if restarted:
            self.copies_lost = ()
        if another:
            self.latched = NO_FAULT
        # A device that was reset has its saved values again: those known are void.
        self.values.clear()
        self.board = None

    def end_session(self) -> None:
        """The session is over: what may have changed since is void."""
        self.watched_values = None
        self.rolling_mps = None
        self.hold = None
        if self.sensors_if_asked is not None:
            self.sensors_if_asked.forget()

    @property
    def sensors(self) -> SensorStream:
        """What the sensors measure. It is made when it is asked for: many programs only drive."""
        if self.sensors_if_asked is None:
            from .sensor_stream import SensorStream

            with self._making:  # any thread may ask
                self.sensors_if_asked = self.sensors_if_asked or SensorStream()
        return self.sensors_if_asked

    def standing_notice(self, happening: Happening) -> StandingNotice | None:
        """What to tell a new listener of what holds the device; None if nothing does."""
        if happening is Happening.FAULT and self.latched:
            return StandingNotice(happening, self.latched)
        if happening is Happening.HELD and self.hold is not None and self.hold.held:
            return StandingNotice(happening, self.held_by(self.hold))
        return None

    # --- parameters and board --------------------------------------------------------------------

    def take_value(self, parameter: int, value: float) -> None:
        """Take the value of a parameter."""
        self.values[parameter] = value
        if parameter in (REARM_GAP.id, TTL_MAX.id):
            self._setpoints.take_gap(parameter, value)
        if parameter in self.watched and self.watched_values is not None:
            self.collect_watched()

    def collect_watched(self) -> None:
        """Replace the watched values, unless one is still missing."""
        known = self.values
        if all(parameter in known for parameter in self.watched):
            self.watched_values = {parameter: known[parameter] for parameter in self.watched}

    def take_board(self, answer: Answer) -> None:
        """Take the device's report of its board, or that it was confirmed."""
        if isinstance(answer, ConfigurationValue):
            with suppress(ValueError):
                self.board = ActiveBoard.from_value(answer)
        # Going back to the image's own board takes a restart, after which the device is asked
        # again.
        elif self.board is not None and self.board.state is ConfigurationState.TRIAL:
            self.board = self.board._replace(state=ConfigurationState.STORED)

    def board_mismatch(self, expected: ExpectedBoard | None) -> BoardMismatch | None:
        """The error of a device that is not on the expected board."""
        found = self.board
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

    # --- events and faults -----------------------------------------------------------------------

    def take_event(self, event: Event) -> None:
        """Track the supervisor: without a stream, only events show its state.

        Raises:
            ValueError: A code means nothing.
        """
        if event.code == EventCode.ROLLING:
            self.rolling_mps = event.speed_mps
            self._warn(
                "the robot rolls at %.2f m/s although nothing drives it: on a slope, set stop_mode "
                "to 3 (brake until driven) and block the wheels",
                event.speed_mps,
            )
        if event.code in _COPIES and (code := EventCode(event.code)) not in self.copies_lost:
            self.copies_lost = *self.copies_lost, code
            self._warn("%s If it recurs, the flash wears out: replace the board.", code.doc)
        # All other events tell the state in `after`, also those about the stores.
        self._setpoints.supervisor = SupervisorState(event.after)
        self._setpoints.faults = Fault(event.faults)
        self.note_latched(self._setpoints.faults)

    def note_latched(self, faults: Fault) -> None:
        """Take what is latched, and tell of a fault that was not latched before."""
        if faults & ~self.latched:
            self._notices.append((Happening.FAULT, faults))
        self.latched = faults

    def end_rolling(self, newest: Measurement, reported_mps: float) -> None:
        """Forget that the robot rolls once a sample shows that it drives, or has slowed down."""
        fastest_mps = max(abs(newest.state.left_mps), abs(newest.state.right_mps))
        # Half, as in the device, which reports again only after the robot was slower than that.
        if newest.supervisor is SupervisorState.DRIVING or fastest_mps < reported_mps / 2:
            self.rolling_mps = None

    # --- what holds the robot --------------------------------------------------------------------

    def held_by(self, hold: Hold) -> HeldBy:
        """What holds the robot, by what the device said. From any thread."""
        if self._setpoints.is_unarmed and not hold.held & UNARMED:
            # A setpoint was refused here, or so lately that the device has not reported it yet.
            hold = hold._replace(held=hold.held | Held.UNARMED)
        return HeldBy.of(hold, self._setpoints.faults)

    def take_hold(self, hold: Hold) -> None:
        """Take what holds the robot.

        Raises:
            ValueError: A code means nothing.
        """
        HeldBy.of(hold, NO_FAULT)
        LastStop.of(hold, None)
        self.hold = hold
        self._setpoints.on_held(Held(hold.held))

    def tell_held(self) -> None:
        """Tell what holds the robot, if that has changed. The session is open."""
        if self.hold is None:
            return
        held_by = self.held_by(self.hold)
        if held_by != self._told_held:
            self._told_held = held_by
            self._notices.append((Happening.HELD, held_by))
