"""The simulated device as a process: the firmware's core with a model robot behind a port."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import count
from pathlib import Path
from secrets import token_hex
from socket import socket as Socket  # noqa: N812 - `socket` is an argument
from tempfile import gettempdir
from typing import IO, Any, TypeVar, cast

from wheelwire_protocol import native
from wheelwire_protocol.codes import Fault, ResetReason, SupervisorState

from ..errors import SimulatorNotFound, WheelwireError
from ..link import LOG

PROGRAM = "wheelwire-fwsim"
ENVIRONMENT = "WHEELWIRE_FWSIM"
ANSWER_TIMEOUT_S = 10.0
SIGNAL_S = 1.0
EXIT_TIMEOUT_S = 5.0
STATES_KEPT = 100_000

_PACKAGE = Path(__file__).parents[1]

Self = TypeVar("Self", bound="Simulator")


def find_simulator() -> Path:
    """Find the simulator's program: $WHEELWIRE_FWSIM, a checkout's build, or the wheel's own.

    Raises:
        SimulatorNotFound: The program was not found.
    """
    named = os.environ.get(ENVIRONMENT)
    if named:
        if not os.access(named, os.X_OK):
            raise SimulatorNotFound(
                f"${ENVIRONMENT} is {named}, which is not a program: correct or unset it"
            )
        return Path(named)
    program = native.locate(PROGRAM, _PACKAGE)
    if not os.access(program, os.X_OK):
        raise SimulatorNotFound(f"the simulator {program} does not exist: {native.remedy()}")
    return program


@dataclass(frozen=True, slots=True)
class TrueState:
    """The true state of the simulated robot, which a host cannot know.

    Attributes:
        drive_changed: Reported because the drive was switched on or off, not periodically.
        host_us: `time.monotonic()` when it was reported. [us]
        t_us: Simulated time. [us]
        device_us: The device's clock, also used for all times below. [us]
        boot_id: Random number drawn by the device at each reset.
        x_m: Position of the middle between the wheels. [m]
        y_m: The same in y. [m]
        heading_rad: Counter-clockwise positive, not wrapped. [rad]
        distance_m: Length of the path so far. [m]
        left_mps: True speed at the rim. [m/s]
        right_mps: True speed at the rim. [m/s]
        left_ticks: Ticks that a perfect encoder would have counted since the start.
        right_ticks: The same on the right.
        drive_on: Whether a motor is driven; braking is not driving.
        drive_removed_us: When `drive_on` last became false.
        deadline_us: Deadline of the last setpoint accepted.
        stands_still: Whether both wheels are at rest.
        standstill_us: When `stands_still` last became true.
        state: State of the supervisor.
        faults: Latched faults.
    """

    drive_changed: bool
    host_us: int
    t_us: int
    device_us: int
    boot_id: int
    x_m: float
    y_m: float
    heading_rad: float
    distance_m: float
    left_mps: float
    right_mps: float
    left_ticks: int
    right_ticks: int
    drive_on: bool
    drive_removed_us: int
    deadline_us: int
    stands_still: bool
    standstill_us: int
    state: SupervisorState
    faults: Fault


def parse_true_state(line: Mapping[str, Any]) -> TrueState:
    """Parse one line of the simulator's stream of true states."""
    values = {f.name: line[f.name] for f in fields(TrueState) if f.name in line}
    values["drive_changed"] = line["event"] == "drive"
    values["state"] = SupervisorState(line["state"])
    values["faults"] = Fault(line["faults"])
    return TrueState(**values)


class Simulator:
    """A simulated device in real time, running during a `with` block.

    It ends with this process, however this process ends.

    Args:
        link: Path of a symbolic link to the port, so that the port has a known name; by default a
            new one among the temporary files.
        seed: Seed of boot ids and encoder errors; random by default.
        baud_rate: Baud rate of the device's UART; 0 accepts any rate, like USB.
        store: File for saved parameters; by default they stay in memory.
        settings: Variables of the simulation, with their values at power-on.
        truth_hz: Rate of the true states. [Hz]
        on_state: Called with each true state, from the thread that reads them. What it raises is
            logged.
        arguments: Further arguments; see `wheelwire-fwsim --help`.
        socket: A connected socket that the simulator inherits as its port; closed here afterwards.
    """

    def __init__(
        self,
        *,
        link: Path | None = None,
        seed: int | None = None,
        baud_rate: int = 0,
        store: Path | None = None,
        settings: Mapping[str, float] | None = None,
        truth_hz: float = 0.0,
        on_state: Callable[[TrueState], None] | None = None,
        arguments: Sequence[str] = (),
        socket: Socket | None = None,
    ) -> None:
        if link is None and socket is None:
            # Not the pseudo-terminal's own name: the system may give that to another terminal, and
            # a program that waits for this simulator to return would open it.
            link = Path(gettempdir()) / f"wheelwire-{token_hex(8)}"
        options = {
            "link": link,
            "seed": seed,
            "baud-rate": baud_rate or None,
            "store": store,
            "truth-hz": truth_hz or None,
        }
        self._arguments = [f"--{name}={v}" for name, v in options.items() if v is not None]
        self._arguments += [
            f"--set={name}={float(value)!r}" for name, value in (settings or {}).items()
        ]
        self._arguments += arguments
        self._socket = socket
        self._link = link
        self._on_state = on_state
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None
        self._answers: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._states: deque[TrueState] = deque(maxlen=STATES_KEPT)
        # Reentrant: a command sent by a signal handler during another one gets an error instead of
        # a deadlock.
        self._command_lock = threading.RLock()
        self._commanding = False
        self._numbers = count(1)
        self._unreadable: Exception | None = None
        self._port = ""

    def start(self) -> None:
        """Start the process and wait until its port exists.

        Raises:
            SimulatorNotFound: The simulator is not built.
            WheelwireError: It refused its arguments. The message has its reason.
        """
        inherited, arguments = self._inheritance()
        # However this process ends, the kernel closes the pipe to the simulator's standard input,
        # and the simulator ends, too.
        process = subprocess.Popen(
            [str(find_simulator()), "--exit-with-stdin", *arguments, *self._arguments],
            pass_fds=inherited,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            # Out of reach of the terminal's Ctrl-C: the application has to stop the robot first.
            start_new_session=True,
        )
        self._process = process
        # The process has a copy. While this one is open, the peer would not see that one's end.
        if self._socket is not None:
            self._socket.close()
        # True states come unasked, between the answers to commands.
        self._reader = threading.Thread(
            target=self._read, args=(process,), name="simulator", daemon=True
        )
        self._reader.start()
        try:
            self._port = str(self._answer(None)["port"])
        except BaseException:
            # Also after Ctrl-C: nothing else knows of the process yet.
            self.close()
            raise

    def wait(self) -> int:
        """Wait until the process ends by itself; returns its exit code."""
        process = self._running()
        while True:
            # With a limit: Python handles a signal that came just before the wait only after it.
            with contextlib.suppress(subprocess.TimeoutExpired):
                return process.wait(SIGNAL_S)

    def close(self) -> None:
        """End the process, which removes the port and the link to it."""
        process, self._process = self._process, None
        if process is None:
            return
        # It ends with its standard input. To one that has ended already, what is still in the
        # buffer cannot be written.
        with contextlib.suppress(BrokenPipeError):
            _pipe(process.stdin).close()
        try:
            process.wait(EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        # Before closing the pipe that the thread reads.
        if self._reader:
            self._reader.join()
        _pipe(process.stdout).close()
        _pipe(process.stderr).close()

    def __enter__(self: Self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def port(self) -> str:
        """The port for a host."""
        return str(self._link or self._port)

    @property
    def pid(self) -> int:
        """Process id of the simulator."""
        return self._running().pid

    def command(self, line: str) -> dict[str, Any]:
        """Send one command and return its answer.

        Raises:
            WheelwireError: The simulator refused it, or has ended.
        """
        with self._command_lock:
            if self._commanding:
                raise WheelwireError(
                    f"`{line}` interrupts another command to the simulator: send it afterwards"
                )
            self._commanding = True
            try:
                answer = self._ask(line)
            finally:
                self._commanding = False
        if not answer["ok"]:
            raise WheelwireError(f"the simulator refused `{line}`: {answer['error']}")
        return answer

    def _ask(self, line: str) -> dict[str, Any]:
        commands = _pipe(self._running().stdin)
        # When a signal handler's exception ends the wait, the answer still comes, and is not to be
        # mistaken for the next command's.
        number = next(self._numbers)
        try:
            commands.write(f"#{number} {line}\n")
            commands.flush()
        except BrokenPipeError:
            raise WheelwireError(f"the simulator has ended: {self._error_output()}") from None
        return self._answer(number)

    def set(self, name: str, value: float) -> None:
        """Set a variable, in its unit."""
        self.command(f"set {name} {float(value)!r}")

    def get(self, name: str) -> float:
        """Read a variable, in its unit."""
        return float(self.command(f"get {name}")["value"])

    def reset(self, reason: ResetReason = ResetReason.EXTERNAL) -> int:
        """Reset the device; returns its new boot id."""
        return int(self.command(f"reset {reason.name.lower()}")["boot_id"])

    def unplug(self) -> None:
        """Pull the cable: the port disappears, the device keeps running."""
        self.command("unplug")

    def plug(self) -> None:
        """Plug the cable in again: a new port at the same link."""
        self._port = str(self.command("plug")["port"])

    def take_states(self) -> list[TrueState]:
        """Take the true states since the last call, oldest first."""
        # Not copied and then cleared: the reading thread may append in between.
        return [self._states.popleft() for _ in range(len(self._states))]

    def _inheritance(self) -> tuple[list[int], list[str]]:
        if self._socket is None:
            return [], []
        fd = self._socket.fileno()
        # A fork of this process may keep socket and pipes open, so their end would not come: the
        # simulator watches the process itself.
        return [fd], [f"--socket={fd}", f"--parent={os.getpid()}"]

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            raise WheelwireError("the simulator is not running; start it first")
        return self._process

    def _read(self, process: subprocess.Popen[str]) -> None:
        try:
            for text in _pipe(process.stdout):
                self._take(json.loads(text))
        except Exception as error:
            LOG.exception("the simulator's output cannot be read")
            self._unreadable = error
        self._answers.put(None)  # a caller may be waiting for an answer

    def _take(self, line: dict[str, Any]) -> None:
        if line["event"] not in {"truth", "drive"}:
            self._answers.put(line)
            return
        state = parse_true_state(line)
        self._states.append(state)
        if self._on_state:
            try:
                self._on_state(state)
            except Exception:  # it is the application's, and the next state may be all right
                LOG.exception("on_state of the simulator failed")

    def _answer(self, number: int | None) -> dict[str, Any]:
        """The answer to the command of this number; None: what it prints at the start."""
        end = time.monotonic() + ANSWER_TIMEOUT_S
        while True:
            try:
                answer = self._answers.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                raise WheelwireError(
                    f"the simulator did not answer within {ANSWER_TIMEOUT_S:g} s: start it again"
                ) from None
            if answer is None:
                self._answers.put(None)  # for the next command, too
                if self._unreadable is not None:
                    raise WheelwireError(
                        f"the simulator's output cannot be read ({self._unreadable!r}): start it "
                        "again"
                    )
                raise WheelwireError(f"the simulator has ended: {self._error_output()}")
            if answer.get("number") == number:
                return answer

    def _error_output(self) -> str:
        # Read to its end, which comes: the process has ended.
        return _pipe(self._running().stderr).read().strip() or "it gave no reason"


def _pipe(stream: IO[str] | None) -> IO[str]:
    """A stream that was requested as a pipe, so it is not None."""
    return cast("IO[str]", stream)
