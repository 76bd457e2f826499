"""The simulated device in virtual time: a thin wrapper of libfwsim's C interface."""

from __future__ import annotations

import ctypes
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from wheelwire_protocol import native
from wheelwire_protocol.codes import ResetReason, SupervisorState

from ..errors import SimulatorNotFound, WheelwireError
from . import fwsim_abi as abi
from .fwsim_abi import Status as Status

ENVIRONMENT = "WHEELWIRE_LIBFWSIM"
LIBRARY = f"libfwsim.{'dylib' if sys.platform == 'darwin' else 'so'}"
READ_SIZE = 1 << 16


class FwSimError(WheelwireError):
    """The library refused; nothing was changed."""

    def __init__(self, status: Status, subject: str) -> None:
        super().__init__(f"{subject}: {status.name}")
        self.status = status


@dataclass(frozen=True)
class Variable:
    """A variable of the simulation that can be read, and set if it is `settable`."""

    name: str
    unit: str
    doc: str
    minimum: float
    maximum: float
    settable: bool


def library_path() -> Path:
    """$WHEELWIRE_LIBFWSIM, a checkout's build, or the wheel's own library."""
    named = os.environ.get(ENVIRONMENT)
    return Path(named) if named else native.locate(LIBRARY, Path(__file__).parents[1])


def _load() -> ctypes.CDLL:
    path = library_path()
    if not path.exists():
        raise SimulatorNotFound(f"the library {path} does not exist: {native.remedy()}")
    library = ctypes.CDLL(str(path))
    native.declare(library, abi.SIGNATURES)
    return library


class FwSim:
    """One simulated device and its robot, from power-on at time 0.

    Args:
        seed: Seed of boot ids and encoder errors. The same seed and calls give the same run.
        store: File for saved parameters; by default they stay in memory.
    """

    def __init__(self, seed: int = 1, store: Path | None = None) -> None:
        # Set first: `__del__` reads it, also when the library is missing.
        self._handle: int | None = None
        self._library = _load()
        self._handle = self._library.fwsim_create(seed)
        self._buffer = ctypes.create_string_buffer(READ_SIZE)
        self._done = ctypes.c_int64()
        if store:
            status = self._library.fwsim_use_store(self._handle, os.fsencode(store))
            self._check(status, str(store))

    def close(self) -> None:
        """Free the device. Safe to call more than once."""
        if self._handle:
            self._library.fwsim_destroy(self._handle)
            self._handle = None

    def __enter__(self) -> FwSim:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def preset(self, parameter_id: int, value: float) -> None:
        """Change the default of a parameter, from the next reset on."""
        status = self._library.fwsim_preset(self._handle, parameter_id, value)
        self._check(status, f"parameter {parameter_id}")

    def set(self, name: str, value: float) -> None:
        """Set a variable, in its unit."""
        self._check(self._library.fwsim_set(self._handle, name.encode(), value), name)

    def get(self, name: str) -> float:
        """Read a variable, in its unit."""
        value = ctypes.c_double()
        status = self._library.fwsim_get(self._handle, name.encode(), ctypes.byref(value))
        self._check(status, name)
        return value.value

    @property
    def state(self) -> SupervisorState:
        """State of the supervisor."""
        return SupervisorState(int(self.get("state")))

    def advance_us(self, duration_us: int) -> None:
        """Run device and world for this long."""
        self._check(self._library.fwsim_advance_us(self._handle, duration_us), "advance")

    def advance(self, seconds: float) -> None:
        """Run device and world for this long."""
        self.advance_us(round(seconds * 1e6))

    def advance_to_bytes(self, step_us: int, most_us: int) -> int:
        """Run device and world in steps until one of them brings bytes to the host.

        Args:
            step_us: The length of a step.
            most_us: After which the step in which it ends is the last one.

        Returns:
            The time that has passed, in microseconds: of at least one step.
        """
        count = max(1, -(-most_us // step_us))
        status = self._library.fwsim_advance_to_bytes(
            self._handle, step_us, count, ctypes.byref(self._done)
        )
        self._check(status, "advance")
        return step_us * self._done.value

    def write(self, data: bytes) -> None:
        """Send bytes from the host."""
        self._check(self._library.fwsim_write(self._handle, data, len(data)), "write")

    def read(self) -> bytes:
        """Take all bytes that have reached the host."""
        received = b""
        size = ctypes.c_size_t(READ_SIZE)
        # A buffer that was filled may have left something behind.
        while size.value == READ_SIZE:
            status = self._library.fwsim_read(
                self._handle, self._buffer, READ_SIZE, ctypes.byref(size)
            )
            self._check(status, "read")
            # `raw` would copy all of the buffer, whatever is in it.
            received += ctypes.string_at(self._buffer, size.value)
        return received

    def black_box(self) -> bytes:
        """The device's black box: the last second or two, or those before a fault or an e-stop."""
        size = ctypes.c_size_t()
        status = self._library.fwsim_box(self._handle, self._buffer, READ_SIZE, ctypes.byref(size))
        self._check(status, "box")
        return self._buffer.raw[: size.value]

    def reset(self, reason: ResetReason = ResetReason.EXTERNAL) -> None:
        """Reset the device; it gets a new boot id."""
        self.set("reset", reason)

    def variables(self) -> list[Variable]:
        """All variables of `set` and `get`."""
        described = []
        for index in range(self._library.fwsim_variable_count()):
            raw = abi.Variable()
            self._check(self._library.fwsim_describe(index, ctypes.byref(raw)), "describe")
            described.append(native.typed(Variable, raw))
        return described

    @staticmethod
    def _check(status: int, subject: str) -> None:
        if status != Status.OK:
            raise FwSimError(Status(status), subject)
