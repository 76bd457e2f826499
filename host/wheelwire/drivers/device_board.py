"""The board that a device has stored: read, written, tried, confirmed."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import Any, Protocol, TypeAlias, TypeVar, cast

from wheelwire_protocol.board import BoardState
from wheelwire_protocol.codec import BY_TYPE, CRC_SIZE, HEADER_SIZE, schema_hash
from wheelwire_protocol.codes import Group
from wheelwire_protocol.types import (
    BOARD_LAYOUT,
    BoardConfirm,
    BoardGet,
    BoardValue,
    BoardWrite,
    GroupGet,
    GroupInfo,
    Restart,
)

from ..board import BoardDescription, unpacked
from ..errors import BoardNotKept, GroupUnavailable, LinkLost, WheelwireError
from ..link.connection import LinkInfo
from ..link.requests import Answer, RequestMessage

RESTART_TIMEOUT_S = 8.0
"""A chip is back within one second; the trial of a board ends after ten."""
_POLL_S = 0.02
_FIELDS = len(BOARD_LAYOUT)

Result = TypeVar("Result")
BoardSteps: TypeAlias = Generator[RequestMessage | float, Any, Result]
"""Yields requests, and is sent their answers; and pauses, in seconds."""


class SessionLink(Protocol):
    """A link of which one can tell that its device came back."""

    @property
    def info(self) -> LinkInfo:
        """The device, which has another boot id after each reset. Raises why there is none."""

    def check(self) -> None:
        """Raise why the link is not open, if it is not."""


class RequestingLink(SessionLink, Protocol):
    """A link that waits for the answer to a request."""

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer."""


class BoardOperations:
    """What is done with a device's board, as the requests and pauses that it takes. Sans-IO."""

    def __init__(self, link: SessionLink) -> None:
        self._link = link

    def read(self) -> BoardSteps[tuple[BoardState, BoardDescription | None]]:
        """As `DeviceBoard.read`."""
        # First: a device of another release may mean something else by these messages.
        yield from _check_group()
        value = cast("BoardValue", (yield BoardGet(0, 0)))
        state = BoardState(value.state)
        if state is BoardState.NONE:
            return state, None
        # The message ends with the board's fields, in the layout of a packed board.
        body = BY_TYPE[BoardValue].pack_body(*value)
        return state, unpacked(body[-_packed_size() :])

    def write(self, board: BoardDescription) -> BoardSteps[None]:
        """As `DeviceBoard.write`."""
        yield from _check_group()
        # A message of zeros around the packed board, unpacked, gives the message's fields.
        unpack = BY_TYPE[BoardWrite].unpack
        head = bytes(HEADER_SIZE + _size_of_ids())
        fields = unpack(head + board.packed() + bytes(CRC_SIZE))
        yield BoardWrite(0, 0, *fields[-_FIELDS:])

    def confirm(self, board: BoardDescription) -> BoardSteps[None]:
        """As `DeviceBoard.confirm`."""
        yield from _check_group()
        yield BoardConfirm(0, 0, board.fingerprint())

    def accept(self, board: BoardDescription) -> BoardSteps[None]:
        """As `DeviceBoard.accept`."""
        state, found = yield from self.read()
        # A trial may have ended while somebody compared the board.
        if found is None or found.packed() != board.packed():
            raise BoardNotKept(
                f"the device is on {found.name if found else 'no board'} by now, not on "
                f"{board.name}: nothing was confirmed; write the board again"
            )
        before = self._link.info.device.boot_id
        yield from self.confirm(board)
        if state is BoardState.BUILT_IN:
            yield from self._await_restart(before)
        state, found = yield from self.read()
        if state is not BoardState.STORED or found is None or found.packed() != board.packed():
            raise BoardNotKept(f"{board.name} was not confirmed; try again")

    def take_up(self, board: BoardDescription) -> BoardSteps[None]:
        """As `DeviceBoard.take_up`."""
        yield from self.write(board)
        yield from self.restart()
        state, found = yield from self.read()
        # The packed forms are what was written and saved: there a number may have been rounded.
        same = found is not None and found.packed() == board.packed()
        if state is not BoardState.TRIAL or not same:
            raise BoardNotKept(
                "the new board was not kept; the previous one is active "
                f"({found.name if found else 'none'}): try again"
            )
        # The device was reached on it, so its line to the host is right at least.
        yield from self.confirm(board)

    def restart(self) -> BoardSteps[None]:
        """As `DeviceBoard.restart`."""
        # Before the request: the device may be back before its answer is handed out.
        before = self._link.info.device.boot_id
        yield Restart(0, 0)
        yield from self._await_restart(before)

    def _await_restart(self, before: int) -> BoardSteps[None]:
        """Wait until a session is open with another boot than `before`.

        A new session alone says nothing: a computer that stalls opens one with the same boot.
        """
        end = time.monotonic() + RESTART_TIMEOUT_S
        error: WheelwireError | None = None
        while time.monotonic() < end:
            yield _POLL_S
            try:
                self._link.check()
                if self._link.info.device.boot_id != before:
                    return
            except LinkLost as lost:
                error = lost
        raise LinkLost(
            f"the device did not come back within {RESTART_TIMEOUT_S:g} s of its restart"
            + (f" ({error})" if error else "")
            + "; if it does not in ten more, take its power away for a moment: the previous board "
            "returns"
        )


class DeviceBoard:
    """The board of one device, over its link."""

    def __init__(self, link: RequestingLink) -> None:
        self._operations = BoardOperations(link)
        self._link = link

    def read(self) -> tuple[BoardState, BoardDescription | None]:
        """Whether the active board was confirmed, and the board; None if there is none.

        Raises:
            GroupUnavailable: The device has no messages about boards, or of another release.
            ConfigurationError: The board has codes that are unknown here.
            LinkLost, RequestTimeout: The device was not reached.
        """
        return self._run(self._operations.read())

    def write(self, board: BoardDescription) -> None:
        """Store a board, to be tried at the next restart.

        Raises:
            DeviceRefused: The robot drives, the board breaks a rule of this device, or another
                one is on trial.
            GroupUnavailable, LinkLost, RequestTimeout: As `read`.
        """
        self._run(self._operations.write(board))

    def confirm(self, board: BoardDescription) -> None:
        """Save the board that is on trial, or the firmware's own, and let it drive.

        The firmware's own drives after a restart, which the device begins by itself.

        Args:
            board: What the device is believed to be on, as `read` reported it.

        Raises:
            DeviceRefused: The device has another board, or none that waits for a confirmation.
            GroupUnavailable, LinkLost, RequestTimeout: As `read`.
        """
        self._run(self._operations.confirm(board))

    def accept(self, board: BoardDescription) -> None:
        """Confirm the active board, and wait until the device drives on it.

        Args:
            board: What the device is on, as `read` reported it.

        Raises:
            BoardNotKept: The device is on another board by now, or came back without this one.
            DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As `confirm` and `restart`.
        """
        self._run(self._operations.accept(board))

    def take_up(self, board: BoardDescription) -> None:
        """Write a board, restart the device, and confirm the board if the device comes back on it.

        Raises:
            BoardNotKept: The device is back with the previous board.
            DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As `write` and `restart`.
        """
        self._run(self._operations.take_up(board))

    def restart(self) -> None:
        """Restart the device, and wait until it is back.

        Raises:
            DeviceRefused: The robot drives, or cannot restart by itself.
            LinkLost: It did not come back.
        """
        self._run(self._operations.restart())

    def _run(self, steps: BoardSteps[Result]) -> Result:
        try:
            step = next(steps)
            while True:
                if isinstance(step, float):
                    time.sleep(step)
                    step = next(steps)
                else:
                    step = steps.send(self._link.request(step))
        except StopIteration as end:
            # The operation is over, and this is what its generator returned.
            return cast("Result", end.value)


def _check_group() -> BoardSteps[None]:
    """Raise `GroupUnavailable` unless both sides have the same messages about boards."""
    group = Group.BOARD
    info = cast("GroupInfo", (yield GroupGet(0, 0, group)))
    if info.hash != schema_hash(group):
        raise GroupUnavailable(group.name.lower(), schema_hash(group), info.hash)


def _packed_size() -> int:
    return BY_TYPE[BoardWrite].size - HEADER_SIZE - CRC_SIZE - _size_of_ids()


def _size_of_ids() -> int:
    """Of session_id and request_id, which every request begins with."""
    return BY_TYPE[BoardGet].size - HEADER_SIZE - CRC_SIZE
