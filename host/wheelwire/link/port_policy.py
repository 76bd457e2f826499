"""Decides for a port: which baud rate, when to give up, reopen and rest, the last stop. Sans-IO.

The thread that serves a port asks at the times given here, and does what the answer says.
"""

from __future__ import annotations

from wheelwire_protocol.codes import StopMode

from ..errors import LinkLost, PortUnavailable, WheelwireError, WrongBoard, afresh
from .requests import Answer
from .session import Phase, Session

# In the order of the protocol's specification: the firmware's own default comes first.
USUAL_RATES = (921_600, 115_200, 460_800, 230_400, 1_000_000, 2_000_000)
FIRST_US = 1_000_000
"""Opening a port may reset an ESP32: it needs this long to answer even at the right rate."""
NEXT_US = 500_000
ROUND_US = FIRST_US + (len(USUAL_RATES) - 1) * NEXT_US
"""How long a round takes on a port without a rate. After it, only reopening the port can help."""
UNANSWERED_US = 1_000_000
"""Reopen the port when a device that used to answer is silent for this long: it may be at fault."""
CHECK_US = 1_000_000
"""Between two checks of the port's settings."""
FIRST_PAUSE_S = 0.05
"""Between two attempts to open the port; doubled after each attempt."""
WRONG_BOARD_PAUSE_S = 1.0
"""Before trying again: opening may reset that board, and another program may want the port."""
STOP_ACK_TIMEOUT_US = 500_000
"""How long the device has to acknowledge the last stop."""
REST_US = 10_000
"""How long to rest. At 5000 frames a second, 2500 bytes arrive in this time; a terminal's buffer
holds 4095."""
READ_REST_US = 3_000
"""As `REST_US`, while a program reads samples but does not wait for one."""
IDLE_REST_US = 25_000
"""As `REST_US`, while the robot is not driven, and nobody reads or listens: of the usual 100 frames
a second it gathers two or three."""
IDLE_FRAMES = 60
"""A rest that would take more frames than these is `REST_US` long."""


class BaudSearch:
    """Which rate to try when.

    Args:
        first: The active rate; None for a port without a rate, where there is nothing to try.
        now_us: The host's clock.
    """

    def __init__(self, first: int | None, now_us: int) -> None:
        self.rate = first
        """The first rate of each round: the one at which a device last answered, or was expected
        to."""
        self.tried: list[int] = []
        """The rates in the order of their trial; each once."""
        self.over = False
        """Whether no rate of the round was answered. Then the port is reopened."""
        self._waiting: list[int] = []
        self._due_us: int | None = None
        self.begin(now_us)

    def begin(self, now_us: int) -> None:
        """The port was opened, at `rate`: a round begins."""
        self.over = False
        if self.rate is None:
            self._due_us = now_us + ROUND_US
            return
        self._waiting = [rate for rate in USUAL_RATES if rate != self.rate]
        self._due_us = now_us + FIRST_US
        self._note(self.rate)

    def next(self, now_us: int) -> int | None:
        """The rate to change to now; None when it is not time yet, or the round is over."""
        if self._due_us is None or now_us < self._due_us:
            return None
        if not self._waiting:
            # `_due_us` stays: the round is over at every further look, until the next `begin`.
            self.over = True
            return None
        self._due_us = now_us + NEXT_US
        rate = self._waiting.pop(0)
        self._note(rate)
        return rate

    def end(self, rate: int | None) -> None:
        """A device answered at the active rate."""
        self.rate = rate
        self._due_us = None

    def _note(self, rate: int) -> None:
        if rate not in self.tried:
            self.tried.append(rate)


class Unanswered(LinkLost):
    """The port exists, but nothing answers there: the link reopens it."""


class PortPolicy:
    """When a port is given up, and when it is opened again.

    Args:
        now_us: The host's clock.

    Attributes:
        search: For the baud rate.
        reconnects: How often the port was opened again.
        lost: Why the port itself was last lost, if it was.
    """

    def __init__(self, now_us: int) -> None:
        # It searches no port yet: what was tried may be asked for before one is open.
        self.search = BaudSearch(None, now_us)
        self.reconnects = 0
        self.lost: LinkLost | None = None
        self._was_open = False
        self._pause_s = 0.0
        """Before the next attempt to open the port; grows until a session opens."""
        self._longest_pause_s = FIRST_PAUSE_S
        self._answers_before = 0
        self._check_due_us = 0
        # The one that a warning was given for.
        self._wrong_board = ""

    # --- opening -------------------------------------------------------------------------------

    @property
    def rate(self) -> int:
        """The rate to reopen the port at; 0 for a port without one."""
        return self.search.rate or 0

    def take_pause_s(self) -> float:
        """How long to wait before the attempt to open the port that is now due. Each is longer."""
        # The first attempt has no pause: a cable that was only loose is back at once.
        pause_s = self._pause_s
        self._pause_s = min(max(2 * pause_s, FIRST_PAUSE_S), self._longest_pause_s)
        return pause_s

    def begin(
        self, rate: int | None, longest_pause_s: float, session: Session, now_us: int
    ) -> None:
        """The port was opened, at `rate`."""
        if self._was_open:
            self.reconnects += 1
            # The same search: it knows the answered rate, and the rates already tried.
            self.search.begin(now_us)
        else:
            self.search = BaudSearch(rate, now_us)
        self._was_open = True
        self._longest_pause_s = longest_pause_s
        # An answer from before the port was reopened proves nothing about it.
        self._answers_before = session.answers
        self._check_due_us = now_us + CHECK_US

    @staticmethod
    def error_of_failure(error: WheelwireError) -> LinkLost | None:
        """Why the port, once lost, could not be opened again; None while it is just not there."""
        if isinstance(error, PortUnavailable):
            return None
        return LinkLost(f"{error}; trying again")

    # --- while it is open ----------------------------------------------------------------------

    def session_opened(self) -> None:
        """All is well: the next loss is followed by an attempt without a pause."""
        self._pause_s = 0.0

    def takes_check(self, now_us: int) -> bool:
        """Whether to check the port's settings now. Calling this counts as checking them."""
        if now_us < self._check_due_us:
            return False
        self._check_due_us = now_us + CHECK_US
        return True

    def judge(self, session: Session, rate: int | None, now_us: int) -> None:
        """Raise why the port is to be closed, if it is.

        Args:
            session: On the port.
            rate: The active one.
            now_us: The host's clock.

        Raises:
            Unanswered: A device that used to answer has fallen silent.
            WrongBoard: Another board is there than the one that the link was opened to.
        """
        # Any answer to a hello proves the rate, even if it refuses the session.
        if session.answers > self._answers_before:
            self.search.end(rate)
            since_us = session.unanswered_since_us
            if since_us is not None and now_us >= since_us + UNANSWERED_US:
                raise Unanswered("the device no longer answers; reopening the port")
        # In HELLO alone: during a session `error` is a previous one's.
        if session.phase is Phase.HELLO and isinstance(session.error, WrongBoard):
            self._pause_s = WRONG_BOARD_PAUSE_S
            raise afresh(session.error)

    def next_rate(self, now_us: int) -> int | None:
        """The baud rate to change to now, if any; raises `Unanswered` after the last one."""
        rate = self.search.next(now_us)
        if self.search.over:
            raise Unanswered("nothing answers at any usual baud rate; reopening the port")
        return rate

    def note_lost(self, error: LinkLost) -> bool:
        """Note that the port was closed because of `error`; returns whether to warn of it."""
        # A port that is reopened on suspicion is not lost: its device may be merely silent.
        self.lost = None if isinstance(error, Unanswered) else error
        # The port is tried again for as long as that board is there: one warning is enough.
        if not isinstance(error, WrongBoard) or error.found == self._wrong_board:
            return False
        self._wrong_board = error.found
        return True


class LastStop:
    """The stop that precedes the closing of a port."""

    def __init__(self) -> None:
        self._until_us: int | None = None
        self._answered = False

    @property
    def begun(self) -> bool:
        """The stop was handed to the session."""
        return self._until_us is not None

    def begin(self, session: Session, now_us: int) -> None:
        """Make the session stop the robot."""
        self._until_us = now_us + STOP_ACK_TIMEOUT_US
        session.stop(StopMode.CONFIGURED, self._on_answer, now_us)

    def is_over(self, now_us: int, *, all_written: bool) -> bool:
        """Whether the port may be closed: the device has acknowledged it, or had its time.

        Args:
            now_us: The host's clock.
            all_written: Nothing is left to be written to the port.
        """
        if self._until_us is None:
            return False
        # An error is an answer, too: there is no session, and the stop is in the output.
        return (self._answered and all_written) or now_us >= self._until_us

    def _on_answer(self, _result: Answer | WheelwireError) -> None:
        self._answered = True


class Coalescing:
    """Distinguishes a fast stream, which fills several frames into a rest, from a slow one.

    Also expects the stream's next state.
    """

    def __init__(self) -> None:
        self.rest_until_us = 0
        """When to read again; in the past for a slow stream: each frame is read when it comes."""
        self.short_rest_until_us = 0
        """The same for a program that reads samples."""
        self.idle_until_us = 0
        """The same for an idle robot: the latest of the three."""
        self.next_us = 0
        """When the next state is expected at the latest, by the longer of the two newest gaps."""
        self._gap_us = 0
        self._frames = 0
        self._read_us = 0
        self._state_us = 0

    def note_read(
        self, frames: int, now_us: int, *, has_state: bool = True, has_sensed: bool = False
    ) -> None:
        """Something was read. Answers alone say nothing of what comes next.

        Args:
            frames: How many since the start.
            now_us: The host's clock.
            has_state: It contained a state.
            has_sensed: It contained a sensor's sample.
        """
        if has_state or has_sensed:
            # Several frames in a read, or reads in quick succession: a rest would gather several.
            count, pause_us = frames - self._frames, now_us - self._read_us
            # A rest gathers no more than one frame of a stream that is slower than these.
            gap_us = 0 if count > 1 else pause_us
            self.rest_until_us = now_us + REST_US if gap_us < REST_US // 2 else 0
            is_fast = gap_us < READ_REST_US * 3 // 4
            self.short_rest_until_us = now_us + READ_REST_US if is_fast else 0
            if gap_us < IDLE_REST_US * 3 // 4 and count * IDLE_REST_US <= IDLE_FRAMES * pause_us:
                self.idle_until_us = now_us + IDLE_REST_US
            else:
                self.idle_until_us = self.rest_until_us
            self._read_us = now_us
        else:  # the answer may be to a request for a faster stream
            self.idle_until_us = self.rest_until_us
        self._frames = frames
        if has_state:
            gap_us = now_us - self._state_us
            # Of two, because a delayed state arrives together with the next.
            self.next_us = now_us + max(gap_us, self._gap_us)
            self._state_us, self._gap_us = now_us, gap_us
