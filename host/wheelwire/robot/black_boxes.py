"""What a device has recorded of its stops: its black boxes and its ledger.

Each operation is written once, for asyncio and for threads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple, cast

from wheelwire_protocol import types as wire
from wheelwire_protocol.black_box import BoxHead, head_of
from wheelwire_protocol.codes import Group, RefusalCode, ResetReason, SupervisorEvent

from ..errors import DeviceRefused, GroupUnavailable, InvalidCommand, RecordingError
from .calls import Requests, blocking

_MOST_BOXES = 255
_ROUNDS = 3
"""How often boxes are listed, to find those that are stored while others are read."""
_STOPS = (
    SupervisorEvent.SESSION,
    SupervisorEvent.STOP,
    SupervisorEvent.DEADLINE,
    SupervisorEvent.ESTOP,
    SupervisorEvent.FAULT,
)


class StoredBox(NamedTuple):
    """A black box that a device has stored.

    Attributes:
        head: Why, when and on which board it was stored.
        size: In bytes.
        is_current: Whether it ends with the device's present state, or with the reset that began
            this boot.
    """

    head: BoxHead
    size: int
    is_current: bool


@dataclass(frozen=True)
class Ledger:
    """What happened to a robot in its life.

    Attributes:
        uptime_s: In all [s]. A power cut costs all counts of the last ten minutes at most, any
            other reset a second of this.
        resets: Starts by their reason.
        stops: E-stops and faults, and drives that a session, a stop or a deadline ended.
    """

    uptime_s: int
    resets: Mapping[ResetReason, int]
    stops: Mapping[SupervisorEvent, int]


class Recorded(NamedTuple):
    """All that a device has recorded.

    Attributes:
        boxes: With what each of them holds, the oldest first.
        ledger: None: it has none, or does not say.
        why_none: Why nothing could be read; empty if something was.
    """

    boxes: Sequence[tuple[StoredBox, bytes]] = ()
    ledger: Ledger | None = None
    why_none: str = ""


class AwaitableRecorder:
    """The recorder of one device. It can be read only while the robot does not drive."""

    def __init__(self, requests: Requests) -> None:
        self._requests = requests

    async def boxes(self) -> list[StoredBox]:
        """The stored black boxes, the newest first.

        Raises:
            GroupUnavailable: The device has no recorder, or one of another release.
            RecordingError: One is of a later release than this library.
            DeviceRefused: The robot drives: stop it first.
            LinkLost, RequestTimeout: The device was not reached.
        """
        await self._requests.check_group(Group.RECORDER)
        # By number: a box stored during the download makes all others older.
        found: dict[int, StoredBox] = {}
        for age in range(_MOST_BOXES):
            value = cast("wire.BoxValue", await self._requests.ask(wire.BoxGet(0, 0, age)))
            if value.number == 0:
                break
            try:
                head = head_of(value)
            except ValueError as error:
                raise RecordingError(
                    f"black box {value.number} is of a later release ({error}): use its library"
                ) from error
            found[value.number] = StoredBox(head, value.size, bool(value.is_current))
        return list(found.values())

    async def read_box(self, box: StoredBox) -> bytes:
        """Read a stored black box, as `wheelwire_protocol.black_box.Box` takes it.

        Args:
            box: One of the `boxes`.

        Raises:
            RecordingError: It is no longer there: a newer one has taken its place.
            GroupUnavailable, DeviceRefused, LinkLost, RequestTimeout: As `boxes`.
        """
        await self._requests.check_group(Group.RECORDER)
        number = box.head.number
        image = bytearray()
        while len(image) < box.size:
            request = wire.BoxRead(0, 0, number, len(image))
            part = cast("wire.BoxPart", await self._requests.ask(request))
            if part.size == 0:
                raise RecordingError(
                    f"black box {number} is no longer on the device: a newer one has taken "
                    "its place; list them again"
                )
            image += part.data[: part.size]
        return bytes(image)

    async def ledger(self) -> Ledger:
        """What happened to the robot in its life, up to now.

        Raises:
            GroupUnavailable, DeviceRefused, LinkLost, RequestTimeout: As `boxes`.
        """
        await self._requests.check_group(Group.RECORDER)
        value = cast("wire.LedgerValue", await self._requests.ask(wire.LedgerGet(0, 0)))
        counts = value._asdict()
        return Ledger(
            value.uptime_s,
            {reason: counts[f"resets_{reason.name.lower()}"] for reason in ResetReason},
            {event: counts[f"stops_{event.name.lower()}"] for event in _STOPS},
        )

    async def read(self, *, boxes: bool = True) -> Recorded:
        """Read all of it. If the robot drives or the device has no recorder, `why_none` says so.

        This also reads a box that is stored during the call. A box that cannot be read is empty.

        Args:
            boxes: False: the ledger alone.

        Raises:
            RecordingError: A box is of a later release than this library.
            LinkLost, RequestTimeout: The device was not reached.
        """
        try:
            ledger = await self.ledger()
            return Recorded(await self._read_boxes() if boxes else [], ledger)
        except DeviceRefused as error:
            if error.code != RefusalCode.NOT_STOPPED:
                raise
            return Recorded(why_none="the robot drives: stop it to read its black boxes")
        # A recording, and a program of an older release that holds the port, do not know of it.
        except (GroupUnavailable, InvalidCommand) as error:
            return Recorded(why_none=str(error))

    async def _read_boxes(self) -> list[tuple[StoredBox, bytes]]:
        """The oldest first."""
        images: dict[int, bytes] = {}
        for _ in range(_ROUNDS):
            stored = await self.boxes()
            unread = [box for box in stored if box.head.number not in images]
            if not unread:
                break
            for box in unread:
                with suppress(RecordingError):  # a newer one may have taken its place
                    images[box.head.number] = await self.read_box(box)
        return [(box, images.get(box.head.number, b"")) for box in reversed(stored)]


class DeviceRecorder:
    """The recorder of one device, for threads."""

    def __init__(self, requests: Requests) -> None:
        self._awaited = AwaitableRecorder(requests)

    boxes = blocking(AwaitableRecorder.boxes)
    read_box = blocking(AwaitableRecorder.read_box)
    ledger = blocking(AwaitableRecorder.ledger)
    read = blocking(AwaitableRecorder.read)
