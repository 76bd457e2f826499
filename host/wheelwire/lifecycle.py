"""Whether there is a session with the device, which one, and how far it has come. Sans-IO."""

from __future__ import annotations

import enum
from collections.abc import Callable

from wheelwire_protocol.types import DeviceHello

from .device import BootHistory, DeviceInfo
from .errors import LinkLost, WheelwireError, WrongBoard
from .greeting import Greeting
from .statistics import Tally

SILENCE_US = 2_000_000
"""No ping answered and no state frame for this long: the session is over, say hello again."""


class Phase(enum.Enum):
    """How far the conversation has come."""

    CLOSED = enum.auto()
    """No port."""
    GREETING = enum.auto()
    """Hello is repeated until answered."""
    PREPARING = enum.auto()
    """The clock is read; the stream rate and the watched parameters are settled."""
    OPEN = enum.auto()


_IN_SESSION = (Phase.PREPARING, Phase.OPEN)


class Lifecycle:
    """From hello to the session's end, again and again.

    Args:
        greeting: Says hello.
        tally: Counts what it must not believe.
        any_board: Whether to go on with another board than the first.
        begun: Called with the time whenever a session begins.
        ended: Called with the reason whenever what there was ends.
    """

    def __init__(
        self,
        greeting: Greeting,
        tally: Tally,
        any_board: bool,
        begun: Callable[[int], None],
        ended: Callable[[WheelwireError], None],
    ) -> None:
        self.phase = Phase.CLOSED
        self.error: WheelwireError = LinkLost("the port was not opened yet")
        """Why the session is not open; without meaning while it is."""
        self.device: DeviceInfo | None = None
        """The device of the newest session."""
        self.session_id = 0
        """0 outside a session."""
        self.heard_us = 0
        """When the device was last heard in this session."""
        self.sessions = 0
        self.boots = BootHistory()
        self.answers = 0
        """How often something understood a hello, whether it opened a session or not."""
        self.unanswered_since_us: int | None = None
        """Since when hellos have gone unanswered; None while there is a session or no port."""
        self._greeting = greeting
        self._tally = tally
        self._any_board = any_board
        self._begun = begun
        self._ended = ended

    @property
    def in_session(self) -> bool:
        """The device has opened a session; it may not be ready for use yet."""
        return self.phase in _IN_SESSION

    @property
    def next_deadline_us(self) -> int | None:
        """When `advance` has something to do; None while there is no port."""
        if self.phase is Phase.CLOSED:
            return None
        return self.heard_us + SILENCE_US if self.in_session else self._greeting.due_us

    def advance(self, now_us: int) -> None:
        """Say hello when it is time; end a session whose device fell silent."""
        if self.phase is Phase.GREETING:
            self._greeting.advance(now_us)
        elif self.in_session and now_us >= self.heard_us + SILENCE_US:
            self.greet(LinkLost("the device fell silent; saying hello until it answers"), now_us)

    def greet(self, error: WheelwireError, now_us: int, pause_us: int = 0) -> None:
        """End what there was and begin a session, under a new nonce."""
        self.close(error)
        self.phase = Phase.GREETING
        self.unanswered_since_us = now_us + pause_us
        self._greeting.begin(now_us, pause_us)

    def close(self, error: WheelwireError) -> None:
        """End what there was: the port is gone."""
        self.error = error  # first: other threads ask why as soon as they see the phase
        self.phase = Phase.CLOSED
        self.session_id = 0
        self.unanswered_since_us = None
        self._ended(error)

    def on_hello(self, hello: DeviceHello, now_us: int) -> None:
        """Take an answer to a hello: it may begin a session."""
        if hello.nonce != self._greeting.nonce:
            self._tally.foreign += 1
            return
        self.answers += 1
        if self.in_session:
            self._greet_if_reset(hello.boot_id, now_us)
            return
        self.unanswered_since_us = now_us
        try:
            device = self._greeting.judge(hello)
            self._check_board(device)
        except WheelwireError as error:
            self.error = error
        except ValueError:
            self._tally.invalid += 1
        else:
            self._begin(device, now_us)

    def is_ours(self, session_id: int, now_us: int) -> bool:
        """Whether a message belongs to the session; then the device was heard."""
        ours = self.in_session and session_id == self.session_id
        if ours:
            self.heard_us = now_us
        else:
            self._tally.foreign += 1
        return ours

    def is_this_boot(self, boot_id: int, now_us: int) -> bool:
        """As `is_ours`, by the boot. A boot not heard of yet is a reset, answered with a hello."""
        if not self.in_session or self.device is None:
            return False
        self._greet_if_reset(boot_id, now_us)
        ours = self.device.boot_id == boot_id
        if ours:
            self.heard_us = now_us
        return ours

    def _check_board(self, found: DeviceInfo) -> None:
        first = self.device
        if first is not None and found.board_id != first.board_id and not self._any_board:
            raise WrongBoard(first.board_id, found.board_id)

    def _begin(self, device: DeviceInfo, now_us: int) -> None:
        self.boots.enter(device.boot_id)
        self.device = device
        self.phase = Phase.PREPARING
        self.unanswered_since_us = None
        self.sessions += 1
        self.session_id = self._greeting.nonce ^ device.boot_id
        self.heard_us = now_us
        self._begun(now_us)

    def _greet_if_reset(self, boot_id: int, now_us: int) -> None:
        if self.boots.is_new(boot_id):
            self.greet(LinkLost("the device was reset; a new session is being opened"), now_us)
