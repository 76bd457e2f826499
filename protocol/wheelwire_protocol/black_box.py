"""Black boxes: reading one, and running it again through the firmware's own core.

A box is what a robot was given in the last second or two (counts, times, contact, battery, every
message) and what it did. `Box.rerun` gives the same to the same core again, in virtual time.
"""

from __future__ import annotations

import ctypes
import enum
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

from . import core_abi as abi
from . import native
from .codec import BY_ID, MIN_PAYLOAD
from .codes import BoxCause as BoxCause
from .codes import Fault, RefusalCode, ResetReason, SupervisorEvent, SupervisorState
from .core_abi import BOX_SIZE as BOX_SIZE
from .core_abi import RerunOutcome as RerunOutcome
from .types import AnyMessage, BoxValue

PARTS = 4
"""Number of parts of every box: the oldest part makes room for the next."""


class BoxError(ValueError):
    """The bytes are not a black box, or a damaged one."""


class Kind(enum.IntEnum):
    """What a record is of."""

    STEP = 1
    CONTACT = 2
    TRANSITION = 3
    REFUSAL = 4
    STORE = 5
    HANG_UP = 6
    FAILURE = 7
    STATE = 8
    WIDE_STEP = 9
    MESSAGE = 10
    PARAMETERS = 11
    END = 12


class BoxHead(NamedTuple):
    """What the box says about itself."""

    cause: BoxCause
    reset_reason: ResetReason
    """Reason of the reset after which it was stored; else of the boot that recorded it."""
    number: int
    """Counts up over all boxes of a device."""
    boot_id: int
    core: int
    """Hash of the core's sources: only the same core can re-run it."""
    release: str
    git_hash: int
    """0: not known."""
    board: int
    """Fingerprint; 0: none."""
    faults: Fault
    stored_us: int
    """Device clock."""


class Step(NamedTuple):
    """A control step's inputs. The duties are the outputs up to this step."""

    t_us: int
    left_counter: int
    """Raw, by the pins, from -32767 to 32767."""
    right_counter: int
    battery_mv: int
    left_duty_q15: int
    right_duty_q15: int


class End(NamedTuple):
    """A fault or an e-stop ended the box: the resulting duties."""

    t_us: int
    left_duty_q15: int
    right_duty_q15: int


class Received(NamedTuple):
    """A message that the device read."""

    t_us: int
    message: AnyMessage


class Transition(NamedTuple):
    """A change of the supervisor's state."""

    t_us: int
    event: SupervisorEvent
    before: SupervisorState
    after: SupervisorState
    faults: Fault


class Refusal(NamedTuple):
    """A message that was refused."""

    t_us: int
    message_id: int
    code: RefusalCode


class Contact(NamedTuple):
    """The emergency-stop contact changed."""

    t_us: int
    open: bool


class Stored(NamedTuple):
    """A write to flash."""

    t_us: int
    done: bool


class HangUp(NamedTuple):
    """The end of the connection."""

    t_us: int


Entry = Step | End | Received | Transition | Refusal | Contact | Stored | HangUp


class Rerun(NamedTuple):
    """A re-run, and its first difference from what was recorded."""

    outcome: RerunOutcome
    steps: int
    first_us: int
    """Device clock of the first step."""
    last_us: int
    step: int
    """Step of the first difference, counted from 1."""
    t_us: int
    field: str
    """Which value differs, such as "left_duty_q15" or "robot.drive.left.velocity_umps".

    "record": it did another thing than was recorded, by `Kind`.
    """
    recorded: float
    computed: float


def core_hash() -> int:
    """Hash of the core that is loaded here.

    Raises:
        NativeMissingError: The library is missing or of another release.
    """
    return int(native.load().wheelwire_core_hash())


def release_text(release: int) -> str:
    """Release of the firmware, as `0.1.0`."""
    return f"{release >> 16}.{release >> 8 & 255}.{release & 255}"


class Box:
    """A black box.

    Attributes:
        head: What it says about itself.
        missing: How many of its PARTS cannot be read, the oldest ones: a reset came while one was
            written, or damaged the memory.

    Raises:
        BoxError: The bytes are not a black box, or a damaged one.
        NativeMissingError: The library is missing or of another release.
    """

    def __init__(self, image: bytes) -> None:
        # Set first: `__del__` reads it, also when the library is missing.
        self._handle: ctypes.c_void_p | None = None
        self._library = native.load()
        self._image = bytes(image)
        self._handle, self.head, self.missing = self._open()

    def __del__(self) -> None:
        if self._handle:
            self._library.wheelwire_box_close(self._handle)

    def _open(self) -> tuple[ctypes.c_void_p, BoxHead, int]:
        handle = ctypes.c_void_p()
        head = abi.BoxHead()
        status = self._library.wheelwire_box_open(
            self._image, len(self._image), ctypes.byref(handle), ctypes.byref(head)
        )
        if status == abi.BoxStatus.DAMAGED:
            raise BoxError("a black box that is damaged: its checksum does not match")
        if status != abi.BoxStatus.OPENED:
            raise BoxError("no black box")
        try:
            return handle, head_of(head), head.missing
        except ValueError as error:
            self._library.wheelwire_box_close(handle)
            raise BoxError(f"a black box of a later release: {error}") from error

    def entries(self) -> Iterator[Entry]:
        """Its content, oldest record first, without what only a re-run needs.

        Raises:
            BoxError: A record has a code of a later release.
        """
        handle, *_ = self._open()
        try:
            raw = abi.BoxEntry()
            while self._library.wheelwire_box_next(handle, ctypes.byref(raw)):
                try:
                    entry = _entry(raw)
                except ValueError as error:
                    raise BoxError(f"a black box of a later release: {error}") from error
                if entry is not None:
                    yield entry
        finally:
            self._library.wheelwire_box_close(handle)

    def rerun(self, *, any_core: bool = False) -> Rerun:
        """Give its inputs to this core again, and compare what comes of them.

        Args:
            any_core: Also if it is of another core. Then the duties and the state may be others:
                only what the robot did is compared (transitions, refusals, writes to flash).
        """
        raw = abi.Rerun()
        outcome = self._library.wheelwire_box_rerun(self._handle, any_core, ctypes.byref(raw))
        if outcome == RerunOutcome.NO_MEMORY:
            raise MemoryError("no memory to re-run a black box")
        return native.typed(Rerun, raw, outcome=RerunOutcome(outcome))


def head_of(head: abi.BoxHead | BoxValue) -> BoxHead:
    """The head of a box, from the firmware's library or from a message.

    Raises:
        ValueError: It has a code of a later release.
    """
    return native.typed(BoxHead, head, release=release_text(head.release))


_ENTRIES: dict[int, Callable[..., Entry]] = {
    Kind.STEP: Step,
    Kind.WIDE_STEP: Step,
    Kind.END: End,
    Kind.TRANSITION: Transition,
    Kind.REFUSAL: Refusal,
    Kind.HANG_UP: HangUp,
}
"""Records whose fields have the names of the library's."""


def _entry(raw: abi.BoxEntry) -> Entry | None:
    match raw.kind:
        case Kind.MESSAGE:
            return _received(raw)
        case Kind.CONTACT:
            return Contact(raw.t_us, bool(raw.flag))
        case Kind.STORE:
            return Stored(raw.t_us, bool(raw.flag))
    kind = _ENTRIES.get(raw.kind)
    return None if kind is None else native.typed(kind, raw)


def _received(raw: abi.BoxEntry) -> Received | None:
    codec = BY_ID.get(raw.message_id)
    body = bytes(raw.body[: raw.body_size])
    # A box of a later release may hold messages that are not known here.
    if codec is None or len(body) != codec.size - MIN_PAYLOAD:
        return None
    return Received(raw.t_us, codec.type(*struct.unpack(f"<{codec.formats}", body)))
