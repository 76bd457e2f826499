"""The two ends of a link, and what is counted for `statistics`."""

from __future__ import annotations

from array import array
from collections import deque
from typing import NamedTuple

from wheelwire_protocol.codec import (
    BOARD,
    BY_TYPE,
    PROTOCOL_VERSION,
    assembled,
    fingerprint_of,
    schema_hash,
)
from wheelwire_protocol.codes import (
    Capability,
    Chip,
    ConfigurationState,
    EventCode,
    RefusalCode,
    ResetReason,
)
from wheelwire_protocol.types import ConfigurationValue, DeviceHello

from ..errors import DeviceRefused, LinkLost, ProtocolMismatch, Release


class DeviceInfo(NamedTuple):
    """What a device reports of itself.

    Attributes:
        release: Its firmware's version, protocol version and schema hash.
        git_hash: First 8 hex digits of the firmware's commit; empty when unknown.
        board: What the firmware runs on.
        board_id: The chip's MAC address, as 12 hex digits.
        boot_id: Random at each reset.
        reset_reason: Why it last started.
        capabilities: What it can do, and what it holds for its host.
    """

    release: Release
    git_hash: str
    board: Chip
    board_id: str
    boot_id: int
    reset_reason: ResetReason
    capabilities: Capability

    @property
    def has_core_dump(self) -> bool:
        """Whether its flash held the core dump of a crash when it last started."""
        return Capability.CORE_DUMP in self.capabilities

    @classmethod
    def from_hello(cls, hello: DeviceHello) -> DeviceInfo:
        """Read a hello of our own schema.

        Raises:
            ValueError: It has a code that means nothing.
        """
        return cls(
            release=device_release(hello),
            git_hash=f"{hello.git_hash:08x}" if hello.git_hash else "",
            board=Chip(hello.board),
            board_id=f"{hello.board_id:012x}",
            boot_id=hello.boot_id,
            reset_reason=ResetReason(hello.reset_reason),
            capabilities=Capability(hello.capabilities),
        )


class ActiveBoard(NamedTuple):
    """The board that a device is on, with its peripherals.

    Attributes:
        name: As in its file; empty while none can be used.
        state: Whether it was confirmed, or is on trial.
        fingerprint: The checksum that names it and its peripherals.
        has_contact: Whether it has an e-stop contact.
        peripheral_count: How many peripherals it has.
        bare_fingerprint: The one that it would have without them.
    """

    name: str
    state: ConfigurationState
    fingerprint: int
    has_contact: bool
    peripheral_count: int
    bare_fingerprint: int

    @property
    def is_confirmed(self) -> bool:
        """Whether the device drives on it."""
        return self.state is ConfigurationState.STORED

    @classmethod
    def from_value(cls, value: ConfigurationValue) -> ActiveBoard:
        """Read a device's answer.

        Raises:
            ValueError: It has a state that means nothing.
        """
        state = ConfigurationState(value.state)
        if state is ConfigurationState.DAMAGED:  # the fields of a board mean nothing
            return cls("", state, 0, False, 0, 0)
        name = bytes(value.name).rstrip(b"\0").decode("ascii", "replace")
        body = BY_TYPE[ConfigurationValue].pack_body(*value)
        bare = fingerprint_of(assembled(body[-BOARD.size :], []))
        has_contact, count = value.estop >= 0, value.peripheral_count
        return cls(name, state, value.fingerprint, has_contact, count, bare)


class LinkInfo(NamedTuple):
    """What a link is at this moment."""

    port: str
    baud_rate: int | None
    """The rate at which the device answered; None if the port has none."""
    low_latency: bool | None
    """See `transports.Transport`."""
    device: DeviceInfo
    board: ActiveBoard | None
    """The board that the device is on; None until it has said so, and where it cannot tell."""
    copies_lost: tuple[EventCode, ...] = ()
    """The stored blocks of which the device found only one of two copies when it started."""


class ExpectedBoard(NamedTuple):
    """The board that a device has to be on."""

    name: str
    fingerprint: int
    is_bare: bool
    """It names no peripherals. The robot may have any, because they can only forbid motion."""


class BootHistory:
    """The boot ids of a device, so that a late frame of an earlier boot is not taken as a reset."""

    def __init__(self) -> None:
        self.resets = 0
        # More than frames on their way can belong to; it must not grow with each reset.
        self._boots: deque[int] = deque(maxlen=8)

    @property
    def ids(self) -> list[int]:
        """The last ones, in order."""
        return list(self._boots)

    def enter(self, boot_id: int) -> None:
        """A session with this boot was opened."""
        if self.is_new(boot_id):
            # The first boot seen is not a reset.
            self.resets += bool(self._boots)
            self._boots.append(boot_id)

    def is_new(self, boot_id: int) -> bool:
        """Whether this boot id is new."""
        return boot_id not in self._boots


def device_of_session(hello: DeviceHello) -> DeviceInfo:
    """Check an answer to a hello, and return who opened the session.

    Raises:
        ProtocolMismatch: The device has another protocol version or schema; no session.
        LinkLost: The device is still starting; no session yet.
        DeviceRefused: It refused for another reason; no session.
        ValueError: The answer contains an unknown code.
    """
    # Before anything else: in another release the codes may mean something else.
    if (hello.protocol_version, hello.schema_hash) != (PROTOCOL_VERSION, schema_hash()):
        raise ProtocolMismatch(host_release(), device_release(hello))
    # Not a DeviceRefused, which ends an opening: this one passes by itself.
    if hello.refusal == RefusalCode.BOOTING:
        raise LinkLost("the device is still starting; wait a moment")
    if hello.refusal != RefusalCode.NONE:
        raise DeviceRefused(hello.refusal, "the session")
    return DeviceInfo.from_hello(hello)


def device_release(hello: DeviceHello) -> Release:
    """The device's side of a comparison; readable in every protocol version."""
    firmware = f"{hello.version_major}.{hello.version_minor}.{hello.version_patch}"
    return Release(hello.protocol_version, hello.schema_hash, firmware)


def host_release() -> Release:
    """This library's side of a comparison."""
    return Release(PROTOCOL_VERSION, schema_hash(), library_version())


def library_version() -> str:
    """The version of the installed distribution; `unknown` in an uninstalled checkout."""
    from importlib import metadata  # here: it is slow to import

    try:
        return metadata.version("wheelwire")
    except metadata.PackageNotFoundError:
        return "unknown"


RECENT_US = 1_000_000
_NOTE_US = 100_000


class RecentCounts:
    """What came in the last second. One thread adds; any may read.

    Attributes:
        due_us: When to note next.
    """

    def __init__(self) -> None:
        self.due_us = 0
        self._notes: tuple[tuple[int, int, int, int], ...] = ()
        """Time, state frames, good frames and lost frames. Replaced as a whole."""

    def note(self, now_us: int, states: int, received: int, lost: int) -> None:
        """Counts since the start, right before what comes at `now_us` is counted."""
        self.due_us = now_us + _NOTE_US
        kept = RECENT_US // _NOTE_US
        self._notes = (*self._notes[-kept:], (now_us, states, received, lost))

    def rate_and_loss(
        self, now_us: int, states: int, received: int, lost: int
    ) -> tuple[float, float]:
        """State frames a second, and the part of the frames that was lost."""
        recent = [note for note in self._notes if note[0] >= now_us - RECENT_US]
        if not recent:
            return 0.0, 0.0
        begin_us, states_before, received_before, lost_before = recent[0]
        # One that comes late is taken off the lost ones again, so these may go back.
        missing = max(0, lost - lost_before)
        came = received - received_before
        return (
            # The counts just after opening do not give a rate yet: a second is the least to divide
            # by a tenth of.
            (states - states_before) / max(now_us - begin_us, _NOTE_US) * 1e6,
            missing / (missing + came) if missing else 0.0,
        )


ROUND_TRIPS = 1024


class RoundTrips:
    """The last `ROUND_TRIPS` round trips, in memory that does not grow. One thread adds."""

    def __init__(self) -> None:
        self._us = array("q", bytes(8 * ROUND_TRIPS))
        self._count = 0

    @property
    def newest_us(self) -> array[int]:
        """A copy, unordered. Any thread may ask: the array is copied atomically."""
        return self._us[: self._count]

    def add(self, round_trip_us: int) -> None:
        """Add one, in place of the oldest once there are `ROUND_TRIPS`."""
        self._us[self._count % ROUND_TRIPS] = round_trip_us
        self._count += 1
