"""libfwsim's robot behind a computer's pins, in real time: their levels in, encoder edges out."""

from __future__ import annotations

import ctypes
import json
import sys
import threading
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from wheelwire.board import Configuration
from wheelwire.pi.gpio.base import HIGH_Q15, encoder_pins
from wheelwire.simulation import fwsim_abi as abi
from wheelwire.simulation.libfwsim import library_path
from wheelwire_protocol.native import declare
from wheelwire_protocol.power_stages import OUTPUTS

EDGE = np.dtype(abi.Edge)
CATCH_UP_US = 100_000
"""After a longer gap, such as a stopped process, the robot's time continues from now."""
GPIOS = 28
COUNTS_PER_REVOLUTION = 360
BATCH_S = 0.001
SHOWN = 20
"""The newest changes of the drive that an answer has."""


def clock_us() -> int:
    return time.monotonic_ns() // 1000


class BareRobot:
    """Two wheels and their encoders behind the power stages of a board.

    Args:
        board: What leads to which GPIO.

    Attributes:
        encoders: The GPIOs of both wheels' channels.
        driven: Whether a motor is driven; braking is not driving.
        driven_changed_us: When that changed last.
        changes: Time, whether a motor is driven, whether one is braked, and who wrote a pin last.
    """

    def __init__(self, board: Configuration) -> None:
        # It holds the interpreter's lock: a call takes microseconds, and to have the lock back
        # takes milliseconds while other threads are busy.
        self._library = library = ctypes.PyDLL(str(library_path()))
        declare(library, abi.SIGNATURES)
        packed, now_ns = board.packed(), time.monotonic_ns()
        self._robot = library.fwsim_robot_create(packed, len(packed), COUNTS_PER_REVOLUTION, now_ns)
        assert self._robot, "the board is damaged"
        self._edges, self._count = ctypes.POINTER(abi.Edge)(), ctypes.c_size_t()
        self._lock = threading.Lock()
        stage = [getattr(wheel, n) for wheel in (board.left, board.right) for n in OUTPUTS]
        self._inputs = [pin for pin in (*stage, board.standby) if pin is not None]
        self.encoders = (*encoder_pins(board.left), *encoder_pins(board.right))
        self._duties = (ctypes.c_uint16 * GPIOS)()
        self.driven = False
        self.driven_changed_us = 0
        self.changes: list[tuple[int, bool, bool, int | str]] = []

    def set_pins(self, duty: Callable[[int], float], writer: int | str) -> None:
        """Apply the levels of the stages' inputs; `duty` is that of a GPIO, 0..1."""
        with self._lock:
            for gpio in self._inputs:
                self._duties[gpio] = round(duty(gpio) * HIGH_Q15)
            found = self._library.fwsim_robot_set_pins(self._robot, self._duties, GPIOS)
            driven, braked = bool(found & 1), bool(found & 2)
            now_us = clock_us()
            if driven != self.driven:
                self.driven, self.driven_changed_us = driven, now_us
            if not self.changes or self.changes[-1][1:3] != (driven, braked):
                self.changes.append((now_us, driven, braked, writer))

    def advance(self) -> npt.NDArray[np.void]:
        """Let time pass until now; returns the edges of EDGE in their order."""
        edges, count = ctypes.byref(self._edges), ctypes.byref(self._count)
        now_ns, longest_ns = time.monotonic_ns(), CATCH_UP_US * 1000
        self._library.fwsim_robot_advance(self._robot, now_ns, longest_ns, edges, count)
        size = self._count.value * EDGE.itemsize
        return np.frombuffer(ctypes.string_at(self._edges, size) if size else b"", EDGE)

    @property
    def ticks(self) -> tuple[int, int]:
        """What perfect encoders would have counted since the start: left, right."""
        left, right = (self._library.fwsim_robot_ticks(self._robot, side) for side in (0, 1))
        return left, right

    def obey(self, command: str = "", *arguments: str) -> None:
        """A stand-in's command; the robot ignores those of others."""
        if command == "spin":
            self.spin(float(arguments[0]))
        elif command == "dead_left_encoder":
            self._library.fwsim_robot_kill_encoder(self._robot, 0)

    def spin(self, ticks_per_s: float) -> None:
        """Turn both wheels at this rate from now on, whatever the motors do."""
        self._library.fwsim_robot_spin(self._robot, ticks_per_s)


def run(
    robot: BareRobot, advance: Callable[[], None], answer: Callable[..., dict[str, object]]
) -> None:
    """A stand-in's whole work: it advances by itself, and does what lines on its input say.

    A line of JSON says at first, and after each command, what is true.
    """

    def advance_for_ever() -> None:
        while True:
            time.sleep(BATCH_S)
            advance()

    def say(*words: str) -> None:
        robot.obey(*words)
        truth = {
            **answer(*words),
            "ticks": robot.ticks,
            "driven": robot.driven,
            "driven_changed_us": robot.driven_changed_us,
            "changes": robot.changes[-SHOWN:],
        }
        print(json.dumps(truth), flush=True)  # noqa: T201

    threading.Thread(target=advance_for_ever, daemon=True).start()
    say()
    for line in sys.stdin:
        say(*line.split())
