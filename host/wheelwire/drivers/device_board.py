"""Reads, writes, tries and confirms what a device has stored: its board and its peripherals.

Each operation is written once, for asyncio and for threads.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, cast

from wheelwire_protocol.board import BoardState
from wheelwire_protocol.codec import BY_TYPE
from wheelwire_protocol.codes import Group
from wheelwire_protocol.native import NativeMissingError
from wheelwire_protocol.sensors import PeripheralsState
from wheelwire_protocol.types import (
    BoardConfirm,
    BoardGet,
    BoardValue,
    BoardWrite,
    PeripheralGet,
    PeripheralsConfirm,
    PeripheralSet,
    PeripheralsWrite,
    PeripheralValue,
    Restart,
)

from ..board import PACKED, BoardDescription, unpacked
from ..errors import (
    BoardNotKept,
    ConfigurationError,
    GroupUnavailable,
    LinkLost,
    WheelwireError,
)
from ..peripherals import (
    ENTRY,
    Peripheral,
    fingerprint,
    packed_entry,
    peripheral_problems,
    unpacked_entry,
)
from .requests import Requests, blocking

RESTART_TIMEOUT_S = 8.0
"""A chip is back within one second; the trial of a board ends after ten."""
_POLL_S = 0.02


class StoredPeripherals(NamedTuple):
    """The active list of a device's peripherals.

    Attributes:
        state: Where it is from.
        entries: By channel; empty while it cannot be used.
        fingerprint: The checksum that names it.
    """

    state: PeripheralsState
    entries: tuple[Peripheral, ...]
    fingerprint: int


class AwaitableBoard:
    """The board of one device, and its peripherals."""

    def __init__(self, requests: Requests) -> None:
        self._requests = requests

    async def read(self) -> tuple[BoardState, BoardDescription | None]:
        """Whether the active board was confirmed, and the board; None if there is none.

        It has the peripherals that are active on it, see `read_peripherals`.

        Raises:
            GroupUnavailable: The device has no messages about boards, or those of another release.
            ConfigurationError: The board has codes that are unknown here.
            LinkLost, RequestTimeout: The device was not reached.
        """
        state, board = await self._read_board()
        if board is None:
            return state, None
        stored = await self.read_peripherals()
        return state, replace(board, peripherals=stored.entries) if stored else board

    async def read_peripherals(self) -> StoredPeripherals | None:
        """The active list of peripherals; None if the firmware has no messages about them.

        Raises:
            ConfigurationError: An entry has codes that are unknown here.
            LinkLost, RequestTimeout: The device was not reached.
        """
        try:
            await self._requests.check_group(Group.SENSOR)
        except GroupUnavailable:
            return None
        value = cast("PeripheralValue", await self._requests.ask(PeripheralGet(0, 0, 0)))
        values = [value]
        for channel in range(1, value.channel_count):
            answer = await self._requests.ask(PeripheralGet(0, 0, channel))
            values.append(cast("PeripheralValue", answer))
        # Each message ends with the entry's fields, in the layout of a packed entry.
        pack = BY_TYPE[PeripheralValue].pack_body
        packed = [pack(*one)[-ENTRY.size :] for one in values[: value.channel_count]]
        entries = tuple(map(unpacked_entry, packed))
        return StoredPeripherals(PeripheralsState(value.state), entries, value.crc)

    async def write(self, board: BoardDescription) -> None:
        """Store a board and its peripherals, to be tried at the next restart.

        A board that the device is on already is not written again with other peripherals.

        Raises:
            ConfigurationError: The peripherals break a rule, which is named. Nothing was written.
            DeviceRefused: The robot drives, the board breaks a rule of this device, or another
                one is on trial.
            GroupUnavailable: As `read`; or the board has peripherals, and the firmware has no
                messages about them. Nothing was written.
            LinkLost, RequestTimeout: As `read`.
        """
        await self._write(board)

    async def confirm(self, board: BoardDescription) -> None:
        """Save what is on trial, the firmware's own board too, and let it drive.

        The firmware's own board drives after a restart, which the device begins by itself.

        Args:
            board: The board that the device is on, as `read` reported it.

        Raises:
            DeviceRefused: The device has another board, or none that waits for a confirmation.
            GroupUnavailable, LinkLost, RequestTimeout: As `read`.
        """
        state, _ = await self._read_board()
        stored = await self.read_peripherals()
        if stored is not None and stored.state is PeripheralsState.TRIAL:
            # First: a board without its peripherals drives nothing, the other way round it would.
            await self._requests.ask(PeripheralsConfirm(0, 0, stored.fingerprint))
            if state is BoardState.STORED:
                return
        await self._requests.ask(BoardConfirm(0, 0, board.fingerprint()))

    async def accept(self, board: BoardDescription) -> None:
        """Confirm the active board and its peripherals, and wait until the device drives on it.

        Args:
            board: The board that the device is on, as `read` reported it.

        Raises:
            BoardNotKept: The device is on another board by now, or came back without this one.
            ConfigurationError: It is on the board, but its stored peripherals are not of it.
            DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As `confirm` and `restart`.
        """
        state, found = await self.read()
        # A trial may have ended while somebody compared the board.
        if found is None or not _is_same(found, board):
            raise BoardNotKept(
                f"the device is on {found.name if found else 'no board'} by now, not on "
                f"{board.name}: nothing was confirmed; write the board again"
            )
        before = self._requests.link.info.device.boot_id
        if state is not BoardState.STORED or await self._list_state() is PeripheralsState.TRIAL:
            await self.confirm(board)
        if state is BoardState.BUILT_IN:
            await self._await_restart(before)
        state, found = await self._read_board()
        if state is not BoardState.STORED or found is None or not _is_same(found, board):
            raise BoardNotKept(f"{board.name} was not confirmed; try again")
        if await self._list_state() is PeripheralsState.UNUSABLE:
            raise ConfigurationError(
                f"{board.name} is confirmed, but the list of peripherals that is stored is "
                "damaged or of another board, and nothing drives: write the board's file, which "
                "names them, with `wheelwire board write`"
            )

    async def take_up(self, board: BoardDescription) -> None:
        """Write a board and its peripherals, restart, and confirm both if they come back.

        Raises:
            BoardNotKept: The device is back with the previous board, or the previous peripherals.
            ConfigurationError, DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As
                `write` and `restart`.
        """
        has_new_board, has_new_list = await self._write(board)
        await self.restart()
        state, found = await self._read_board()
        expected = BoardState.TRIAL if has_new_board else BoardState.STORED
        # The packed forms are what was written and saved: there a number may have been rounded.
        if state is not expected or found is None or not _is_same(found, board):
            raise BoardNotKept(
                "the new board was not kept; the previous one is active "
                f"({found.name if found else 'none'}): try again"
            )
        # The device was reached on it, so its line to the host is right at least.
        if has_new_list:
            stored = await self.read_peripherals()
            wanted = fingerprint(board.peripherals, board.fingerprint())
            if stored is None or (stored.state, stored.fingerprint) != (
                PeripheralsState.TRIAL,
                wanted,
            ):
                raise BoardNotKept(
                    "the new peripherals were not kept, and nothing was confirmed: try again; if "
                    "that does not help, the firmware is of another release, and has other rules "
                    "for them"
                )
        await self.confirm(board)

    async def _read_board(self) -> tuple[BoardState, BoardDescription | None]:
        # First: a device of another release may mean something else by these messages.
        await self._requests.check_group(Group.BOARD)
        value = cast("BoardValue", await self._requests.ask(BoardGet(0, 0)))
        state = BoardState(value.state)
        if state is BoardState.NONE:
            return state, None
        # The message ends with the board's fields, in the layout of a packed board.
        body = BY_TYPE[BoardValue].pack_body(*value)
        return state, unpacked(body[-PACKED.size :])

    async def _write(self, board: BoardDescription) -> tuple[bool, bool]:
        """As `write`; returns whether the next restart tries the board, and the peripherals."""
        state, found = await self._read_board()
        stored = await self.read_peripherals()
        if stored is None:
            if board.peripherals:
                needed_by = f"{board.name} has peripherals, and nothing was written"
                await self._requests.check_group(Group.SENSOR, needed_by)
            has_list = False
        else:
            _check_peripherals(board)
            # Where none was ever stored, one that is left out means the same as an empty one.
            has_list = bool(board.peripherals) or stored.state is not PeripheralsState.EMPTY
        is_on_it = state is BoardState.STORED and found is not None and _is_same(found, board)
        has_board = not (is_on_it and has_list)
        # The board last: without its peripherals a restart would leave one that drives nothing.
        if has_list:
            await self._write_peripherals(board)
        if has_board:
            await self._requests.ask(BoardWrite(0, 0, *PACKED.unpack(board.packed())))
        return has_board, has_list

    async def _write_peripherals(self, board: BoardDescription) -> None:
        for channel, entry in enumerate(board.peripherals):
            fields = ENTRY.unpack(packed_entry(entry))
            await self._requests.ask(PeripheralSet(0, 0, channel, *fields))
        of_board = board.fingerprint()
        crc = fingerprint(board.peripherals, of_board)
        await self._requests.ask(PeripheralsWrite(0, 0, len(board.peripherals), of_board, crc))

    async def _list_state(self) -> PeripheralsState | None:
        stored = await self.read_peripherals()
        return None if stored is None else stored.state

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
        """Wait until a session is open with another boot than `before`, and knows its board.

        A new session alone proves no restart: a computer that stalls opens one with the same boot.
        """
        link = self._requests.link
        end_us = link.clock_us() + round(RESTART_TIMEOUT_S * 1e6)
        error: WheelwireError | None = None
        while link.clock_us() < end_us:
            await self._requests.pause(_POLL_S)
            try:
                link.check()
                if link.info.device.boot_id != before and link.knows_device:
                    return
            except LinkLost as lost:
                error = lost
        raise LinkLost(
            f"the device did not come back within {RESTART_TIMEOUT_S:g} s of its restart"
            + (f" ({error})" if error else "")
            + "; if it is not back in ten more, switch its power off for a moment: the previous "
            "board then replaces one that was on trial"
        )


class DeviceBoard:
    """The board of one device, and its peripherals, for threads."""

    def __init__(self, requests: Requests) -> None:
        self._awaited = AwaitableBoard(requests)

    read = blocking(AwaitableBoard.read)
    read_peripherals = blocking(AwaitableBoard.read_peripherals)
    write = blocking(AwaitableBoard.write)
    confirm = blocking(AwaitableBoard.confirm)
    accept = blocking(AwaitableBoard.accept)
    take_up = blocking(AwaitableBoard.take_up)
    restart = blocking(AwaitableBoard.restart)


def _check_peripherals(board: BoardDescription) -> None:
    """Raise what is wrong with them: the device says of a list only that it cannot use it."""
    try:
        problems = peripheral_problems(board.peripherals, board.packed())
    except NativeMissingError:
        return  # the device has the same rules
    if problems:
        raise ConfigurationError(
            f"{board.name}: these peripherals cannot be used, and nothing was written: "
            + "; ".join(problems)
        )


def _is_same(found: BoardDescription, board: BoardDescription) -> bool:
    return found.packed() == board.packed()
