"""The simulated device as a process: the firmware's core with a model robot, behind a port."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from socket import socket as Socket  # noqa: N812 - `socket` is an argument
from types import TracebackType
from typing import IO, Any, TypeVar, cast

from wheelwire_protocol import native
from wheelwire_protocol.codes import Fault, ResetReason, SupervisorState

from ..errors import SimulatorNotFound, WheelwireError

PROGRAM = "wheelwire-fwsim"
ENVIRONMENT = "WHEELWIRE_FWSIM"
ANSWER_TIMEOUT_S = 10.0
EXIT_TIMEOUT_S = 5.0
STATES_KEPT = 100_000

_PACKAGE = Path(__file__).parents[1]

Self = TypeVar("Self", bound="Simulator")


def find_simulator() -> Path:
    """The simulator's program: $WHEELWIRE_FWSIM, a checkout's build, or what the wheel brought.

    Raises:
        SimulatorNotFound: It is not there.
    """
    named = os.environ.get(ENVIRONMENT)
    if named:
        if not os.access(named, os.X_OK):
            raise SimulatorNotFound(f"${ENVIRONMENT} is {named}, which is no program")
        return Path(named)
    program = native.locate(PROGRAM, _PACKAGE)
    if not os.access(program, os.X_OK):
        raise SimulatorNotFound(f"there is no simulator, {program}: {native.remedy()}")
    return program


@dataclass(frozen=True, slots=True)
class TrueState:
    """What the simulated robot really does; the host cannot know it.

    Attributes:
        drive_changed: Reported because the drive was applied or removed, not because it was time.
        host_us: `time.monotonic()` when it was reported. [us]
        t_us: Simulated time. [us]
        device_us: The device's clock, as all times below. [us]
        boot_id: The device's, random at each reset.
        x_m: Position of the middle between the wheels. [m]
        y_m: As `x_m`.
        heading_rad: Counter-clockwise positive, not wrapped. [rad]
        distance_m: Length of the path so far. [m]
        left_mps: True speed at the rim. [m/s]
        right_mps: True speed at the rim. [m/s]
        left_ticks: What a faultless encoder would have counted since the start.
        right_ticks: As `left_ticks`.
        drive_on: Current is driven through a motor; a braking bridge does not drive.
        drive_removed_us: When `drive_on` last ended.
        deadline_us: Of the last setpoint that was accepted.
        stands_still: Both wheels.
        standstill_us: When `stands_still` last began.
        state: The safety supervisor's.
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
    """A line of the simulator's truth stream."""
    values = {f.name: line[f.name] for f in fields(TrueState) if f.name in line}
    values["drive_changed"] = line["event"] == "drive"
    values["state"] = SupervisorState(line["state"])
    values["faults"] = Fault(line["faults"])
    return TrueState(**values)


class Simulator:
    """A simulated device that runs from `with` to the end of its block, in real time.

    It ends with this process, however this process ends.

    Args:
        link: Path of a symbolic link to the port, so that the port has a known name.
        seed: Of boot ids and encoder errors; random without one.
        baud: Of the device's UART; 0 understands any rate, as USB does.
        store: File of the saved parameters; without one they are kept in memory.
        settings: Variables of the simulation and their values at power-on.
        truth_hz: Rate of the true states. [Hz]
        on_state: Called with each true state, from the thread that reads them.
        arguments: More of them, as `wheelwire-fwsim --help` says.
        socket: A connected one, inherited by the simulator as its port; closed here once it has.
    """

    def __init__(
        self,
        *,
        link: Path | None = None,
        seed: int | None = None,
        baud: int = 0,
        store: Path | None = None,
        settings: Mapping[str, float] | None = None,
        truth_hz: float = 0.0,
        on_state: Callable[[TrueState], None] | None = None,
        arguments: Sequence[str] = (),
        socket: Socket | None = None,
    ) -> None:
        options = {
            "link": link,
            "seed": seed,
            "baud": baud,
            "store": store,
            "truth-hz": truth_hz,
        }
        self._arguments = [f"--{name}={value}" for name, value in options.items() if value]
        self._arguments += [f"--set={name}={value}" for name, value in (settings or {}).items()]
        self._arguments += arguments
        self._socket = socket
        self._link = link
        self._on_state = on_state
        self._process: subprocess.Popen[str] | None = None
        self._reader: threading.Thread | None = None
        self._answers: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._states: deque[TrueState] = deque(maxlen=STATES_KEPT)
        # One that the same thread may take twice, in a signal handler: it is told, not stuck.
        self._command_lock = threading.RLock()
        self._commanding = False
        self._port = ""

    def start(self) -> None:
        """Start the process and wait until its port is there.

        Raises:
            SimulatorNotFound: It is not built.
            WheelwireError: It refuses its arguments, and says why.
        """
        inherited, arguments = self._inheritance()
        process = subprocess.Popen(
            [str(find_simulator()), "--exit-with-stdin", *arguments, *self._arguments],
            pass_fds=inherited,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            # A Ctrl-C is for us: the robot is to be stopped before its simulation ends.
            start_new_session=True,
        )
        self._process = process
        if self._socket is not None:
            self._socket.close()
        self._reader = threading.Thread(
            target=self._read, args=(process,), name="simulator", daemon=True
        )
        self._reader.start()
        try:
            self._port = str(self._next_answer()["port"])
        except BaseException:
            self.close()
            raise

    def wait(self) -> None:
        """Wait until the process ends by itself."""
        self._running().wait()

    def close(self) -> None:
        """End the process; the port and the link to it go with it."""
        process, self._process = self._process, None
        if process is None:
            return
        with contextlib.suppress(BrokenPipeError):
            _pipe(process.stdin).close()
        try:
            process.wait(EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if self._reader:
            self._reader.join()
        _pipe(process.stdout).close()
        _pipe(process.stderr).close()

    def __enter__(self: Self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def port(self) -> str:
        """Where a host connects: the link, or the pseudo-terminal itself."""
        return str(self._link) if self._link else self._port

    @property
    def pid(self) -> int:
        """Of the simulator's process."""
        return self._running().pid

    def command(self, line: str) -> dict[str, Any]:
        """Send one command and return its answer.

        Raises:
            WheelwireError: The simulator refuses, or has ended.
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
            raise WheelwireError(f"the simulator refuses `{line}`: {answer['error']}")
        return answer

    def _ask(self, line: str) -> dict[str, Any]:
        commands = _pipe(self._running().stdin)
        try:
            commands.write(line + "\n")
            commands.flush()
        except BrokenPipeError:
            raise WheelwireError(f"the simulator has ended: {self._last_words()}") from None
        return self._next_answer()

    def set(self, name: str, value: float) -> None:
        """Set a variable, in its unit."""
        self.command(f"set {name} {float(value)!r}")

    def get(self, name: str) -> float:
        """Read a variable, in its unit."""
        return float(self.command(f"get {name}")["value"])

    def reset(self, reason: ResetReason = ResetReason.EXTERNAL) -> int:
        """Start the device again; returns its new boot id."""
        return int(self.command(f"reset {reason.name.lower()}")["boot_id"])

    def unplug(self) -> None:
        """Pull the cable: the port is gone, the device goes on."""
        self.command("unplug")

    def plug(self) -> None:
        """Put the cable back: a new port, at the same link."""
        self._port = str(self.command("plug")["port"])

    def take_states(self) -> list[TrueState]:
        """The true states since the last call, the oldest first."""
        return [self._states.popleft() for _ in range(len(self._states))]

    def _inheritance(self) -> tuple[list[int], list[str]]:
        if self._socket is None:
            return [], []
        fd = self._socket.fileno()
        return [fd], [f"--socket={fd}", f"--parent={os.getpid()}"]

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            raise WheelwireError("the simulator is not running; start it first")
        return self._process

    def _read(self, process: subprocess.Popen[str]) -> None:
        for text in _pipe(process.stdout):
            line = json.loads(text)
            if line["event"] in {"truth", "drive"}:
                state = parse_true_state(line)
                self._states.append(state)
                if self._on_state:
                    self._on_state(state)
            else:
                self._answers.put(line)
        self._answers.put(None)

    def _next_answer(self) -> dict[str, Any]:
        try:
            answer = self._answers.get(timeout=ANSWER_TIMEOUT_S)
        except queue.Empty:
            raise WheelwireError("the simulator does not answer") from None
        if answer is None:
            raise WheelwireError(f"the simulator has ended: {self._last_words()}")
        return answer

    def _last_words(self) -> str:
        return _pipe(self._running().stderr).read().strip() or "it gave no reason"


def _pipe(stream: IO[str] | None) -> IO[str]:
    """A stream that was asked for as a pipe, and so is one."""
    return cast("IO[str]", stream)
