"""The firmware's core, for Python: `firmware/esp32/capi/wheelwire_core.h` by `native`'s library."""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

from . import core_abi as abi
from .board import BoardFault, BoardPin
from .codes import (
    Capability,
    Chip,
    Fault,
    RefusalCode,
    ResetReason,
    SupervisorState,
    fault_flags,
    supervisor_state,
)
from .core_abi import RECORDER_SIZE as RECORDER_SIZE
from .core_abi import TransferResult as TransferResult
from .native import load, typed
from .peripherals import PeripheralFault

# The capacity of the core's own buffer, so that one call empties it.
_TAKE_SIZE = 4096
_MOST_ISSUES = 100


class Identity(NamedTuple):
    """What the robot reports about itself in DeviceHello."""

    boot_id: int
    """Random, 32 bits."""
    board: Chip
    board_id: int = 0
    """64 bits that identify this robot."""
    reset_reason: ResetReason = ResetReason.UNKNOWN
    capabilities: Capability = Capability(0)


class StageInputs(NamedTuple):
    """The inputs of one wheel's power stage: the duty of the PWM on each, 0 to 32767.

    0 is low, 32767 is high; inputs that the stage does not have are 0. Of several that change, set
    first what falls, then what rises, from the last to the first: directions before enables.
    """

    enable_q15: int
    in1_q15: int
    in2_q15: int
    pwm_q15: int
    dir_q15: int


class Outputs(NamedTuple):
    """The levels of the pins from now on, and the supervisor's state."""

    left: StageInputs
    right: StageInputs
    deadline_us: int
    """When the current setpoint expires."""
    period_us: int
    """Time from this step to the next."""
    state: SupervisorState
    faults: Fault


class Core:
    """One robot. Not thread-safe. All times are of one monotonic clock.

    Args:
        identity: What it reports; the board determines the parameters' defaults.
        stored: The block saved last; empty if there is none.
        save: Stores a block permanently; an empty block deletes the stored one. Returns whether it
            succeeded; must not raise.

    Raises:
        NativeMissingError: The library is missing or of another release.
        MemoryError: Out of memory.
    """

    def __init__(
        self,
        identity: Identity,
        stored: bytes = b"",
        save: Callable[[bytes], bool] = lambda _block: False,
    ) -> None:
        # Set first: `__del__` reads it, also when the library is missing.
        self._handle: int | None = None
        self._library = load()
        # Every call writes to the same structure, and `_run` copies it before the caller sees it.
        self._outputs = abi.Outputs()
        self._taken = ctypes.create_string_buffer(_TAKE_SIZE)

        self._save = _saver(save)  # ctypes keeps no reference; must live as long as the core
        reported = abi.Identity(
            identity.board_id,
            identity.boot_id,
            identity.capabilities,
            identity.board,
            identity.reset_reason,
        )
        self._handle = self._library.wheelwire_core_create(
            ctypes.byref(reported), stored, len(stored), self._save, None
        )
        if not self._handle:
            raise MemoryError("no memory for the robot's core")

    def take_board(self, packed: bytes) -> BoardFault:
        """Drive the power stages of this board, before the start. NONE, or its first fault."""
        return BoardFault(self._library.wheelwire_core_board(self._live, packed, len(packed)))

    def keep_latches(self, record: bytes, save: Callable[[bytes], bool]) -> None:
        """Let a latched e-stop and latched faults survive this process; call it before the start.

        Args:
            record: The last argument of `save`; empty if nothing is known to be latched. A damaged
                record counts as an e-stop.
            save: Stores the record. Called at each change, also while driving: it must be quick,
                and must not raise.
        """
        self._save_latches = _saver(save)  # as `_save`: it must live as long as the core
        self._library.wheelwire_core_latches(
            self._live, record, len(record), self._save_latches, None
        )

    def keep_recorder(self, content: bytes, write: Callable[[int, bytes], bool]) -> None:
        """Have a black box and a ledger, which hosts can read; call it before the start.

        Args:
            content: What was written last, RECORDER_SIZE bytes; empty if nothing was.
            write: Stores bytes at an offset; returns whether it succeeded. Called only while the
                wheels stand, once a step at most, and may wait for a disk; it must not raise.

        Raises:
            ValueError: The content is of another size.
            MemoryError: Out of memory.
        """
        if content and len(content) != RECORDER_SIZE:
            raise ValueError(f"a recorder has {RECORDER_SIZE} bytes, not {len(content)}")

        def written(_context: object, offset: int, data: int, size: int) -> int:
            return write(offset, ctypes.string_at(data, size))

        self._write = abi.Write(written)  # as `_save`: it must live as long as the core
        if not self._library.wheelwire_core_recorder(
            self._live, content or None, self._write, None
        ):
            raise MemoryError("no memory for the robot's recorder")

    def sense(self, sensors: Sensors) -> PeripheralFault:
        """Have these peripherals on the board that it was given, before the start.

        Returns:
            NONE, or the list's first fault.
        """
        fault = self._library.wheelwire_core_sense(self._live, sensors.handle)
        self._sensors = sensors  # their memory must live as long as the core
        return PeripheralFault(fault)

    def preset(self, parameter_id: int, value: float) -> RefusalCode:
        """Change the default of a parameter, before the start. NONE, or why it was refused."""
        return RefusalCode(self._library.wheelwire_core_preset(self._live, parameter_id, value))

    def start(self, now_us: int, left_ticks: int, right_ticks: int) -> Outputs:
        """Leave BOOT, once, when the pins are ready; for the arguments see `step`."""
        return self._run(
            self._library.wheelwire_core_start, abi.Inputs(now_us, left_ticks, right_ticks)
        )

    def step(
        self,
        now_us: int,
        left_ticks: int,
        right_ticks: int,
        *,
        battery_mv: int = 0,
        contact_open: bool = False,
        left_illegal: int = 0,
        right_illegal: int = 0,
        levels: int = 0,
    ) -> Outputs:
        """Run one control step; due every `Outputs.period_us`.

        Args:
            now_us: When the ticks were read.
            left_ticks: Cumulative, forward positive, modulo 2^32.
            right_ticks: As `left_ticks`.
            battery_mv: 0: not measured.
            contact_open: Whether the normally-closed e-stop contact is open.
            left_illegal: Impossible transitions, each a lost edge; cumulative.
            right_illegal: As `left_illegal`.
            levels: Levels of the digital inputs among the peripherals: bit n is channel n.
        """
        return self._run(
            self._library.wheelwire_core_step,
            abi.Inputs(
                now_us,
                left_ticks,
                right_ticks,
                battery_mv,
                left_illegal,
                right_illegal,
                contact_open,
                levels,
            ),
        )

    def service(self, now_us: int) -> Outputs:
        """Handle the bytes that were fed, between two steps. A stop acts at once."""
        return self._run(self._library.wheelwire_core_service, now_us)

    def hang_up(self, now_us: int) -> Outputs:
        """Note that the host has disconnected: its setpoint ends at once."""
        return self._run(self._library.wheelwire_core_hang_up, now_us)

    def value(self, parameter_id: int) -> float:
        """The value of a parameter; valid after `start`."""
        return float(self._library.wheelwire_core_value(self._live, parameter_id))

    def fail(self) -> None:
        """Note that a pin failed: DRIVER_FAILED from the next step on, until the end."""
        self._library.wheelwire_core_fail(self._live)

    def feed(self, data: bytes) -> int:
        """Feed bytes from the host; returns how many were accepted."""
        return int(self._library.wheelwire_core_feed(self._live, data, len(data)))

    def take(self) -> bytes:
        """Take all bytes for the host."""
        size = self._library.wheelwire_core_take(self._live, self._taken, _TAKE_SIZE)
        # Not `self._taken.raw[:size]`, which copies the whole buffer first.
        return ctypes.string_at(self._taken, size)

    def close(self) -> None:
        """Free the core. Safe to call more than once."""
        # Forgotten before it is freed: a later call raises, and cannot reach freed memory.
        handle, self._handle = self._handle, None
        if handle:
            self._library.wheelwire_core_destroy(handle)

    def __del__(self) -> None:
        self.close()

    @property
    def _live(self) -> int:
        if not self._handle:
            raise ValueError("this core was closed")
        return self._handle

    def _run(self, function: Any, given: abi.Inputs | int) -> Outputs:
        # ctypes passes a structure by reference where a pointer to one is declared.
        function(self._live, given, ctypes.byref(self._outputs))
        outputs = self._outputs
        return Outputs(
            _stage_inputs(outputs.left),
            _stage_inputs(outputs.right),
            outputs.deadline_us,
            outputs.period_us,
            supervisor_state(outputs.state),
            fault_flags(outputs.faults),
        )


def _saver(save: Callable[[bytes], bool]) -> Any:
    """What the core calls to store a block."""

    def saved(_context: object, block: int | None, size: int) -> int:
        # The core erases its store with a null pointer, which ctypes hands over as None.
        return save(ctypes.string_at(block, size) if block else b"")

    return abi.Save(saved)


Transfer: TypeAlias = Callable[[int, bytes, int], tuple[TransferResult, bytes, int]]
"""Writes bytes to an address, then, unless the number is 0, reads so many after a repeated start.
Returns the result, what was read, and when it ended. It must not raise."""


class Sensors:
    """The peripherals of a robot on this computer's own pins, in memory that a fork shares.

    A process that is forked after this polls a bus, while the first one steps a core.

    Args:
        packed: The packed configuration; `Core.sense` checks the rules of its peripherals.

    Raises:
        NativeMissingError: The library is missing or of another release.
        ValueError: It cannot be read.
    """

    def __init__(self, packed: bytes) -> None:
        self._library = load()
        # Anonymous and shared, at the same address on both sides of a fork, as the library is.
        self._memory = mmap.mmap(-1, self._library.wheelwire_sensors_size())
        start = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        handle = self._library.wheelwire_sensors_create(start, packed, len(packed))
        if not handle:
            raise ValueError("the configuration cannot be read")
        self.handle: int = handle
        """Its address."""

    def poll(self, bus: int, now_us: int, transfer: Transfer) -> int:
        """Do what is due on a bus; returns when to call it next. One caller for each bus."""

        def carried(
            _: object, address: int, out: int, size: int, in_: int, wanted: int, ended_us: Any
        ) -> int:
            result, data, ended_us[0] = transfer(address, ctypes.string_at(out, size), wanted)
            # Fewer bytes than were asked for would be the rest of another read.
            if result is TransferResult.DONE and len(data) != wanted:
                return TransferResult.HUNG
            if data:
                ctypes.memmove(in_, data, len(data))
            return result

        due_us: int = self._library.wheelwire_sensors_poll(
            self.handle, bus, now_us, abi.Transfer(carried), None
        )
        return due_us


class BoardIssue(NamedTuple):
    """One thing that is wrong with a board: the values for the sentence of `fault`."""

    fault: BoardFault
    function: BoardPin
    """What the pin is used for."""
    pin: int
    """GPIO; -1: the fault is of no pin."""
    other: BoardPin
    """Its other use."""
    value: int
    limit: int


def _stage_inputs(stage: abi.Stage) -> StageInputs:
    return StageInputs(stage.enable_q15, stage.in1_q15, stage.in2_q15, stage.pwm_q15, stage.dir_q15)


def _issues(kind: type[ctypes.Structure], check: Any, packed: bytes) -> Any:
    issues = (kind * _MOST_ISSUES)()
    count = check(packed, len(packed), issues, _MOST_ISSUES)
    # The core counts all issues, even if it had no room to write them.
    return issues[: min(count, _MOST_ISSUES)]


def check_board(packed: bytes) -> list[BoardIssue]:
    """What is wrong with the board of a packed configuration, by the core's own rules.

    Raises:
        NativeMissingError: The library is missing or of another release.
    """
    found = _issues(abi.BoardIssue, load().wheelwire_board_check, packed)
    return [typed(BoardIssue, one) for one in found]


class PeripheralIssue(NamedTuple):
    """One thing that is wrong with peripherals: the values for the sentence of `fault`."""

    fault: PeripheralFault
    channel: int
    """Index of the entry; -1: the fault is of none."""
    pin: int
    """GPIO; -1: of none."""
    value: int
    limit: int


def check_peripherals(packed: bytes) -> list[PeripheralIssue]:
    """What is wrong with the peripherals of a packed configuration, as `check_board`.

    Raises:
        NativeMissingError: The library is missing or of another release.
    """
    found = _issues(abi.PeripheralIssue, load().wheelwire_peripherals_check, packed)
    return [typed(PeripheralIssue, one) for one in found]
