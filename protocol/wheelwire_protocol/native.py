"""The firmware's core as a library, loaded from where it is: an installed wheel or a checkout.

`Core` is the robot of `firmware/esp32/capi/wheelwire_core.h`; the decoder of that header is used by
`decoder` and `bulk`. Importing this module loads nothing; the first use does, and raises
`NativeMissingError` where there is no library of this release.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from .codes import Board, Capability, Fault, RefusalCode, ResetReason, SupervisorState
from .types import SCHEMA_HASH

ABI = 3
"""Of `wheelwire_core.h`; a library of another one is refused."""

ENVIRONMENT = "WHEELWIRE_CORE"
LIBRARY = f"libwheelwire_core.{'dylib' if sys.platform == 'darwin' else 'so'}"

_PACKAGE = Path(__file__).parent
_CHECKOUT = _PACKAGE.parents[1]
_TAKE_SIZE = 4096


class NativeMissingError(Exception):
    """The core's library is not there, or is not of this release. The text says what to do."""


class Identity(NamedTuple):
    """What the robot tells of itself in DeviceHello."""

    boot_id: int
    """Random, 32 bits."""
    board: Board
    board_id: int = 0
    """64 bits that name this robot."""
    reset_reason: ResetReason = ResetReason.UNKNOWN
    capabilities: Capability = Capability(0)


class Bridge(NamedTuple):
    """The pins of one half of an L298N. EN is to be low while the inputs change."""

    enable_q15: int
    """Duty of the PWM on EN, 0 to 32767; 0 is low."""
    in1: bool
    in2: bool


class Outputs(NamedTuple):
    """What the pins must have now, and what the supervisor has to say."""

    left: Bridge
    right: Bridge
    deadline_us: int
    """When the setpoint obeyed expires."""
    period_us: int
    """From this step to the next."""
    state: SupervisorState
    faults: Fault


class Core:
    """One robot. Not to be used by two threads at once; times are of one monotonic clock.

    Args:
        identity: What it tells of itself; the board chooses the parameters' defaults.
        stored: The block that was saved last; empty for none.
        save: Keeps a block over a restart, or forgets it when given an empty one. Returns whether
            it could; it must not raise.

    Raises:
        NativeMissingError: There is no library, or not that of this release.
        MemoryError: There is none left.
    """

    def __init__(
        self,
        identity: Identity,
        stored: bytes = b"",
        save: Callable[[bytes], bool] = lambda _block: False,
    ) -> None:
        self._handle: int | None = None
        self._library = load()
        self._outputs = _Outputs()
        self._taken = ctypes.create_string_buffer(_TAKE_SIZE)

        def saved(_context: object, block: int | None, size: int) -> int:
            return save(ctypes.string_at(block, size) if block else b"")

        self._save = _SAVE(saved)  # must live as long as the core
        told = _Identity(
            identity.board_id,
            identity.boot_id,
            identity.capabilities,
            identity.board,
            identity.reset_reason,
        )
        self._handle = self._library.wheelwire_core_create(
            ctypes.byref(told), stored, len(stored), self._save, None
        )
        if not self._handle:
            raise MemoryError("no memory for the robot's core")

    def preset(self, parameter_id: int, value: float) -> RefusalCode:
        """Make another default of a parameter, before the start. NONE, or why not."""
        return RefusalCode(self._library.wheelwire_core_preset(self._live, parameter_id, value))

    def start(
        self,
        now_us: int,
        left_ticks: int,
        right_ticks: int,
        *,
        battery_mv: int = 0,
        contact_open: bool = False,
        left_illegal: int = 0,
        right_illegal: int = 0,
    ) -> Outputs:
        """Leave BOOT: the pins are ready. Once; for the arguments see `step`."""
        return self._run(
            self._library.wheelwire_core_start,
            _Inputs(
                now_us,
                left_ticks,
                right_ticks,
                battery_mv,
                left_illegal,
                right_illegal,
                contact_open,
            ),
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
    ) -> Outputs:
        """One control step, every `Outputs.period_us`.

        Args:
            now_us: When the ticks were read.
            left_ticks: Cumulative, forward positive; modulo 2^32.
            right_ticks: As `left_ticks`.
            battery_mv: 0: not measured.
            contact_open: The e-stop contact, normally closed.
            left_illegal: Transitions that show a lost edge, cumulative.
            right_illegal: As `left_illegal`.
        """
        return self._run(
            self._library.wheelwire_core_step,
            _Inputs(
                now_us,
                left_ticks,
                right_ticks,
                battery_mv,
                left_illegal,
                right_illegal,
                contact_open,
            ),
        )

    def service(self, now_us: int) -> Outputs:
        """Read and answer what came, between two steps. A stop acts at once."""
        self._library.wheelwire_core_service(self._live, now_us, ctypes.byref(self._outputs))
        return self._outputs.values()

    def hang_up(self, now_us: int) -> Outputs:
        """The host is gone, and the line tells: what it commanded ends at once."""
        self._library.wheelwire_core_hang_up(self._live, now_us, ctypes.byref(self._outputs))
        return self._outputs.values()

    def value(self, parameter_id: int) -> float:
        """The value in force of a parameter; from the start on."""
        return float(self._library.wheelwire_core_value(self._live, parameter_id))

    def fail(self) -> None:
        """A pin failed: DRIVER_FAILED from the next step on, for good."""
        self._library.wheelwire_core_fail(self._live)

    def feed(self, data: bytes) -> int:
        """Bytes from the host; returns how many there was room for."""
        return int(self._library.wheelwire_core_feed(self._live, data, len(data)))

    def take(self) -> bytes:
        """All bytes that are ready for the host."""
        size = self._library.wheelwire_core_take(self._live, self._taken, _TAKE_SIZE)
        return ctypes.string_at(self._taken, size)

    def close(self) -> None:
        """Give the memory back. Harmless when repeated."""
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

    def _run(self, function: Any, inputs: _Inputs) -> Outputs:
        function(self._live, ctypes.byref(inputs), ctypes.byref(self._outputs))
        return self._outputs.values()


def locate(name: str, package: Path) -> Path:
    """Where a native part is looked for: in a checkout's build, else in an installed package.

    In a checkout its build only: a copy that was installed there would be out of date unseen.
    """
    return (_CHECKOUT / "build" / "host" if is_checkout() else package) / name


def is_checkout() -> bool:
    """Whether this is a checkout, which builds its native parts itself."""
    return (_CHECKOUT / "firmware").is_dir()


def remedy() -> str:
    """What to do where a native part is missing."""
    if is_checkout():
        return "build it with `make sim`"
    return (
        "install a wheel of wheelwire that is made for this computer, or a C++20 compiler "
        "and then `pip install --force-reinstall --no-binary wheelwire wheelwire`"
    )


def library_path() -> Path:
    """$WHEELWIRE_CORE, or where `locate` has it."""
    named = os.environ.get(ENVIRONMENT)
    return Path(named) if named else locate(LIBRARY, _PACKAGE)


def is_present() -> bool:
    """Whether `load` would find a library of this release."""
    try:
        load()
    except NativeMissingError:
        return False
    return True


@cache
def load() -> ctypes.PyDLL:
    """The library, loaded once a process.

    Its calls keep the interpreter's lock: they take microseconds, and to get the lock back from a
    busy thread takes up to `sys.getswitchinterval()`. For a call that takes long there is
    `load_unlocked`.

    Raises:
        NativeMissingError: It is not there, or of another release.
    """
    path = library_path()
    try:
        library = ctypes.PyDLL(str(path))
    except OSError as error:
        reason = error if path.exists() else f"{path} is not there"
        raise NativeMissingError(
            f"the firmware's core cannot be loaded: {reason}; {_remedy()}"
        ) from None
    try:
        release = library.wheelwire_abi(), library.wheelwire_schema_hash() & 0xFFFFFFFF
    except AttributeError:
        release = (0, 0)
    if release != (ABI, SCHEMA_HASH):
        raise NativeMissingError(f"{path} is not of this release; {_remedy()}")
    _declare(library)
    return library


@cache
def load_unlocked() -> ctypes.CDLL:
    """As `load`; a call lets other threads run meanwhile."""
    library = ctypes.CDLL(load()._name)
    _declare(library)
    return library


def _declare(library: ctypes.CDLL) -> None:
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments


def _remedy() -> str:
    if os.environ.get(ENVIRONMENT):
        return f"unset ${ENVIRONMENT}, or let it name the library of this release"
    return remedy()


class _Identity(ctypes.Structure):
    _fields_ = (
        ("board_id", ctypes.c_uint64),
        ("boot_id", ctypes.c_uint32),
        ("capabilities", ctypes.c_uint32),
        ("board", ctypes.c_uint8),
        ("reset_reason", ctypes.c_uint8),
    )


class _Inputs(ctypes.Structure):
    _fields_ = (
        ("now_us", ctypes.c_uint64),
        ("left_ticks", ctypes.c_int32),
        ("right_ticks", ctypes.c_int32),
        ("battery_mv", ctypes.c_uint16),
        ("left_illegal", ctypes.c_uint32),
        ("right_illegal", ctypes.c_uint32),
        ("contact_open", ctypes.c_uint8),
    )


class _Bridge(ctypes.Structure):
    _fields_ = (
        ("enable_q15", ctypes.c_uint16),
        ("in1", ctypes.c_uint8),
        ("in2", ctypes.c_uint8),
    )

    def values(self) -> Bridge:
        return Bridge(self.enable_q15, bool(self.in1), bool(self.in2))


class _Outputs(ctypes.Structure):
    _fields_ = (
        ("deadline_us", ctypes.c_uint64),
        ("period_us", ctypes.c_uint32),
        ("faults", ctypes.c_uint32),
        ("left", _Bridge),
        ("right", _Bridge),
        ("state", ctypes.c_uint8),
    )

    def values(self) -> Outputs:
        return Outputs(
            self.left.values(),
            self.right.values(),
            self.deadline_us,
            self.period_us,
            SupervisorState(self.state),
            Fault(self.faults),
        )


class Counters64(ctypes.Structure):
    """As `framing.Counters`, in its order."""

    _fields_ = tuple(
        (name, ctypes.c_uint64)
        for name in (
            *("frames", "bad_crc", "bad_cobs", "unknown_id"),
            *("wrong_length", "seq_lost", "repeated"),
        )
    )


_SAVE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
_CORE = _DECODER = ctypes.c_void_p
_BUFFER = ctypes.c_void_p
_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "wheelwire_core_create": (
        _CORE,
        (ctypes.POINTER(_Identity), ctypes.c_char_p, ctypes.c_size_t, _SAVE, ctypes.c_void_p),
    ),
    "wheelwire_core_destroy": (None, (_CORE,)),
    "wheelwire_core_preset": (ctypes.c_uint8, (_CORE, ctypes.c_uint8, ctypes.c_float)),
    "wheelwire_core_start": (
        None,
        (_CORE, ctypes.POINTER(_Inputs), ctypes.POINTER(_Outputs)),
    ),
    "wheelwire_core_step": (
        None,
        (_CORE, ctypes.POINTER(_Inputs), ctypes.POINTER(_Outputs)),
    ),
    "wheelwire_core_service": (None, (_CORE, ctypes.c_uint64, ctypes.POINTER(_Outputs))),
    "wheelwire_core_hang_up": (None, (_CORE, ctypes.c_uint64, ctypes.POINTER(_Outputs))),
    "wheelwire_core_value": (ctypes.c_float, (_CORE, ctypes.c_uint8)),
    "wheelwire_core_fail": (None, (_CORE,)),
    "wheelwire_core_feed": (ctypes.c_size_t, (_CORE, ctypes.c_char_p, ctypes.c_size_t)),
    "wheelwire_core_take": (ctypes.c_size_t, (_CORE, ctypes.c_char_p, ctypes.c_size_t)),
    "wheelwire_decoder_create": (_DECODER, (_BUFFER, _BUFFER)),
    "wheelwire_decoder_destroy": (None, (_DECODER,)),
    "wheelwire_decoder_feed": (
        ctypes.c_size_t,
        (_DECODER, ctypes.c_char_p, ctypes.c_size_t),
    ),
    "wheelwire_decoder_restart_sequence": (None, (_DECODER,)),
    "wheelwire_decoder_restart": (None, (_DECODER,)),
    "wheelwire_decoder_counters": (None, (_DECODER, ctypes.POINTER(Counters64))),
    "wheelwire_decode_capture": (
        ctypes.c_size_t,
        (_BUFFER, ctypes.c_size_t, ctypes.c_uint8, _BUFFER),
    ),
}
