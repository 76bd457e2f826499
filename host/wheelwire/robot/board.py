"""Reads, writes, tries and confirms what a device has stored: its board and its peripherals.

Each operation is written once, for asyncio and for threads.
"""

from __future__ import annotations

from typing import cast

from wheelwire_protocol import types as wire
from wheelwire_protocol.codec import BOARD, BY_TYPE, ENTRY, assembled, fingerprint_of
from wheelwire_protocol.codes import ConfigurationState, Contradiction, Group
from wheelwire_protocol.native import NativeMissingError
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.power_stages import STAGES

from ..board import Configuration, packed_entry, unpacked
from ..errors import BoardNotKept, ConfigurationError, LinkLost, WheelwireError
from ..parameters import number_text
from .calls import Requests, blocking

RESTART_TIMEOUT_S = 8.0
"""A chip is back within one second; the trial of a board ends after ten."""
_POLL_S = 0.02
_READINGS = 3


class AwaitableBoard:
    """The board of one device, and its peripherals."""

    def __init__(self, requests: Requests) -> None:
        self._requests = requests

    async def read(self) -> tuple[ConfigurationState, Configuration | None]:
        """Whether what is active was confirmed, and the board with its peripherals.

        None in place of the board: what is stored cannot be used.

        Raises:
            GroupUnavailable: The device has no messages about boards, or another release's.
            ConfigurationError: The board has codes that are unknown here.
            LinkLost, RequestTimeout: The device was not reached.
        """
        # First: a device of another release may mean something else by these messages.
        await self._requests.check_group(Group.CONFIGURATION)
        for _ in range(_READINGS):
            value = cast(
                "wire.ConfigurationValue", await self._requests.ask(wire.ConfigurationGet(0, 0))
            )
            state = ConfigurationState(value.state)
            if state is ConfigurationState.DAMAGED:
                return state, None
            entries = [
                cast(
                    "wire.PeripheralValue",
                    await self._requests.ask(wire.PeripheralGet(0, 0, channel)),
                )
                for channel in range(value.peripheral_count)
            ]
            # Each message ends with these fields, in the layout in which they are packed.
            packed = assembled(
                BY_TYPE[wire.ConfigurationValue].pack_body(*value)[-BOARD.size :],
                [BY_TYPE[wire.PeripheralValue].pack_body(*one)[-ENTRY.size :] for one in entries],
            )
            # Not if a restart came between two answers: then all are asked for again.
            if fingerprint_of(packed) == value.fingerprint:
                return state, unpacked(packed)
        raise ConfigurationError(
            "the board that the robot reports does not have the fingerprint that it reports: use "
            "firmware and library of one release"
        )

    async def write(self, board: Configuration) -> None:
        """Store a board and its peripherals, to be tried at the next restart.

        Raises:
            ConfigurationError: The peripherals break a rule, which is named. Nothing was written.
            DeviceRefused: The robot drives, the board breaks a rule of this device, or another
                one is on trial.
            GroupUnavailable, LinkLost, RequestTimeout: As `read`.
        """
        await self._requests.check_group(Group.CONFIGURATION)
        _check_peripherals(board)
        fields = BOARD.unpack_from(board.packed())
        await self._requests.ask(wire.BoardSet(0, 0, *fields))
        for channel, one in enumerate(board.peripherals):
            entry = ENTRY.unpack(packed_entry(one))
            await self._requests.ask(wire.PeripheralSet(0, 0, channel, *entry))
        count = len(board.peripherals)
        await self._requests.ask(wire.ConfigurationWrite(0, 0, count, board.fingerprint()))

    async def confirm(self, board: Configuration) -> None:
        """Save what is on trial, the firmware's own board too, and let it drive.

        The firmware's own board drives after a restart, which the device begins by itself.

        Args:
            board: The board that the device is on, as `read` reported it.

        Raises:
            DeviceRefused: The device has another board, or none that waits for a confirmation.
            GroupUnavailable, LinkLost, RequestTimeout: As `read`.
        """
        await self._requests.check_group(Group.CONFIGURATION)
        await self._requests.ask(wire.ConfigurationConfirm(0, 0, board.fingerprint()))

    async def accept(self, board: Configuration) -> None:
        """Confirm the active board, and wait until the device drives on it.

        Args:
            board: The board that the device is on, as `read` reported it.

        Raises:
            BoardNotKept: The device is now on another board, or came back without this one.
            DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As `confirm` and `restart`.
        """
        state, found = await self.read()
        # A trial may have ended while somebody compared the board.
        if found is None or not _is_same(found, board):
            raise BoardNotKept(
                f"the device is now on {found.name if found else 'no board'}, not on "
                f"{board.name}: nothing was confirmed; write the board again"
            )
        before = self._requests.link.info.device.boot_id
        if state is not ConfigurationState.STORED:
            await self.confirm(board)
        if state is ConfigurationState.BUILT_IN:
            await self._await_restart(before)
        state, found = await self.read()
        if state is not ConfigurationState.STORED or found is None or not _is_same(found, board):
            raise BoardNotKept(f"{board.name} was not confirmed; try again")

    async def take_up(self, board: Configuration) -> None:
        """Write a board and its peripherals, restart, and confirm them if they come back.

        Raises:
            BoardNotKept: The device is back with the previous board; or a saved parameter
                contradicts the new one, which is named with its cure, and the device is back on
                the previous board.
            ConfigurationError, DeviceRefused, GroupUnavailable, LinkLost, RequestTimeout: As
                `write` and `restart`.
        """
        await self.write(board)
        await self.restart()
        state, found = await self.read()
        # The packed forms are what was written and saved: there a number may have been rounded.
        if state is not ConfigurationState.TRIAL or found is None or not _is_same(found, board):
            raise BoardNotKept(
                "the new board was not kept; the previous one is active "
                f"({found.name if found else 'none'}): try again"
            )
        contradicting = await self._contradicting(board)
        if contradicting:
            await self.restart()  # ends the trial
            raise BoardNotKept(
                f"{board.name} was tried and not kept, because nothing would drive on it: "
                f"{' '.join(contradicting)} Then write the board again"
            )
        # The device was reached on it, so its line to the host is right at least.
        await self.confirm(board)

    async def _contradicting(self, board: Configuration) -> list[str]:
        """The parameters that contradict the active board, or each other, with the cure of each."""
        answer = cast("wire.Contradictions", await self._requests.ask(wire.ContradictionsGet(0, 0)))
        flags = Contradiction(answer.active)
        sentences = [flag.doc for flag in Contradiction if flag in flags]
        if Contradiction.PWM_FREQUENCY in flags:
            name, limit = "pwm_frequency_hz", STAGES[board.stage].max_frequency_hz
            get = wire.ParameterGet(0, 0, PARAMETER_BY_NAME[name].id)
            value = cast("wire.ParameterValue", await self._requests.ask(get)).value
            sentences[sentences.index(Contradiction.PWM_FREQUENCY.doc)] = (
                f"{name} is {number_text(value)}, and the power stage, {board.stage.name.lower()}, "
                f"takes {limit} at most: run `wheelwire params set {self._requests.link.name} "
                f"{name} {limit} --save`."
            )
        return sentences

    async def restart(self) -> None:
        """Restart the device, and wait until it is back.

        Raises:
            DeviceRefused: The robot drives, or cannot restart by itself.
            LinkLost: It did not come back.
        """
        # Before the request: the device may be back before its answer is handed out.
        before = self._requests.link.info.device.boot_id
        await self._requests.ask(wire.Restart(0, 0))
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
    write = blocking(AwaitableBoard.write)
    confirm = blocking(AwaitableBoard.confirm)
    accept = blocking(AwaitableBoard.accept)
    take_up = blocking(AwaitableBoard.take_up)
    restart = blocking(AwaitableBoard.restart)


def _check_peripherals(board: Configuration) -> None:
    """Raise what is wrong with them: the device says only that it cannot use them."""
    try:
        problems = board.peripheral_problems()
    except NativeMissingError:
        return  # the device has the same rules
    if problems:
        raise ConfigurationError(
            f"{board.name}: these peripherals cannot be used, and nothing was written: "
            + "; ".join(problems)
        )


def _is_same(found: Configuration, board: Configuration) -> bool:
    return found.packed() == board.packed()
