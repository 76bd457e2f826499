"""Reads, writes, tries and confirms the board that a device has stored.

Each operation is written once, for asyncio and for threads.
"""

from __future__ import annotations

import time
from typing import cast

from wheelwire_protocol.board import BoardState
from wheelwire_protocol.codec import BY_TYPE, CRC_SIZE, HEADER_SIZE
from wheelwire_protocol.codes import Group
from wheelwire_protocol.types import (
    BOARD_LAYOUT,
    BoardConfirm,
    BoardGet,
    BoardValue,
    BoardWrite,
    Restart,
)

from ..board import BoardDescription, unpacked
from ..errors import BoardNotKept, LinkLost, WheelwireError
from .requests import Requests, blocking

RESTART_TIMEOUT_S = 8.0
"""A chip is back within one second; the trial of a board ends after ten."""
_POLL_S = 0.02
_FIELDS = len(BOARD_LAYOUT)


class AwaitableBoard:
    """The board of one device."""

    def __init__(self, requests: Requests) -> None:
        self._requests = requests

    async def read(self) -> tuple[BoardState, BoardDescription | None]:
        """Whether the active board was confirmed, and the board; None if there is none.

        Raises:
            GroupUnavailable: The device has no messages about boards, or those of another release.
            ConfigurationError: The board has codes that are unknown here.
            LinkLost, RequestTimeout: The device was not reached.
        """
        # First: a device of another release may mean something else by these messages.
        await self._check_group()
        value = cast("BoardValue", await self._requests.ask(BoardGet(0, 0)))
        state = BoardState(value.state)
        if state is BoardState.NONE:
            return state, None
        # The message ends with the board's fields, in the layout of a packed board.
        body = BY_TYPE[BoardValue].pack_body(*value)
        return state, unpacked(body[-_packed_size() :])

    async def write(self, board: BoardDescription) -> None:
        """Store a board, to be tried at the next restart.

        Raises:
            DeviceRefused: The robot drives, the board breaks a rule of this device, or another
                one is on trial.
            GroupUnavailable, LinkLost, RequestTimeout: As `read`.
        """
        await self._check_group()
        # A message of zeros around the packed board, unpacked, gives the message's fields.
        unpack = BY_TYPE[BoardWrite].unpack
        head = bytes(HEADER_SIZE + _size_of_ids())
        fields = unpack(head + board.packed() + bytes(CRC_SIZE))
        await self._requests.ask(BoardWrite(0, 0, *fields[-_FIELDS:]))

    async def confirm(self, board: BoardDescription) -> None:
        """Save the board that is on trial, or the firmware's own, and let it drive.

        The firmware's own drives after a restart, which the device begins by itself.

        Args:
            board: The board that the device is on, as `read` reported it.

        Raises:
            DeviceRefused: The device has another board, or none that waits for a confirmation.
            GroupUnavailable, LinkLost, RequestTimeout: As `read`.
        """
        await self._check_group()
        await self._requests.ask(BoardConfirm(0, 0, board.fingerprint()))

    async def accept(self, board: BoardDescription) -> None:
        """Confirm the active board, and wait until the device drives on it.

        Args:
            board: The board that the device is on, as `read` reported it.

        Raises:
            BoardNotKept: The device is on another board by now, or came back without this one.
            DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As `confirm` and `restart`.
        """
        state, found = await self.read()
        # A trial may have ended while somebody compared the board.
        if found is None or found.packed() != board.packed():
            raise BoardNotKept(
                f"the device is on {found.name if found else 'no board'} by now, not on "
                f"{board.name}: nothing was confirmed; write the board again"
            )
        before = self._requests.link.info.device.boot_id
        await self.confirm(board)
        if state is BoardState.BUILT_IN:
            await self._await_restart(before)
        state, found = await self.read()
        if state is not BoardState.STORED or found is None or found.packed() != board.packed():
            raise BoardNotKept(f"{board.name} was not confirmed; try again")

    async def take_up(self, board: BoardDescription) -> None:
        """Write a board, restart the device, and confirm the board if the device comes back on it.

        Raises:
            BoardNotKept: The device is back with the previous board.
            DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As `write` and `restart`.
        """
        await self.write(board)
        await self.restart()
        state, found = await self.read()
        # The packed forms are what was written and saved: there a number may have been rounded.
        same = found is not None and found.packed() == board.packed()
        if state is not BoardState.TRIAL or not same:
            raise BoardNotKept(
                "the new board was not kept; the previous one is active "
                f"({found.name if found else 'none'}): try again"
            )
        # The device was reached on it, so its line to the host is right at least.
        await self.confirm(board)

    async def restart(self) -> None:
        """Restart the device, and wait until it is back.

        Raises:
            DeviceRefused: The robot drives, or cannot restart by itself.
            LinkLost: It did not come back.
        """
        # Before the request: the device may be back before its answer is handed out.
        before = self._requests.link.info.device.boot_id
        await self._requests.ask(Restart(0, 0))
        await self._await_restart(before)

    async def _await_restart(self, before: int) -> None:
        """Wait until a session is open with another boot than `before`.

        A new session alone proves no restart: a computer that stalls opens one with the same boot.
        """
        end = time.monotonic() + RESTART_TIMEOUT_S
        error: WheelwireError | None = None
        while time.monotonic() < end:
            await self._requests.pause(_POLL_S)
            try:
                self._requests.link.check()
                if self._requests.link.info.device.boot_id != before:
                    return
            except LinkLost as lost:
                error = lost
        raise LinkLost(
            f"the device did not come back within {RESTART_TIMEOUT_S:g} s of its restart"
            + (f" ({error})" if error else "")
            + "; if it is not back in ten more, switch its power off for a moment: the previous "
            "board then replaces one that was on trial"
        )

    async def _check_group(self) -> None:
        await self._requests.check_group(Group.BOARD)


class DeviceBoard:
    """The board of one device, for threads."""

    def __init__(self, requests: Requests) -> None:
        self._awaited = AwaitableBoard(requests)

    read = blocking(AwaitableBoard.read)
    write = blocking(AwaitableBoard.write)
    confirm = blocking(AwaitableBoard.confirm)
    accept = blocking(AwaitableBoard.accept)
    take_up = blocking(AwaitableBoard.take_up)
    restart = blocking(AwaitableBoard.restart)


def _packed_size() -> int:
    return BY_TYPE[BoardWrite].size - HEADER_SIZE - CRC_SIZE - _size_of_ids()


def _size_of_ids() -> int:
    """The size of session_id and request_id, with which every request begins."""
    return BY_TYPE[BoardGet].size - HEADER_SIZE - CRC_SIZE
