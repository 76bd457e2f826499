"""Applications that drive a robot through any driver, and failures of them or their processes."""

from __future__ import annotations

import json
import mmap
import os
import select
import signal
import struct
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any
from unittest import mock

from wheelwire.simulation.simulator import ENVIRONMENT, Simulator, find_simulator

from .crashes import folder_in_memory
from .gpio_chip_process import GpioChip
from .pigpio_process import PigpioProcess
from .processes import children, interruptible
from .stand_in import StandIn
from .waiting import wait_until

TTL_S = 0.3
LONG_TTL_S = 5.0
"""Longer than what is measured: whatever ends the drive before it is not the deadline."""
LONG_LIFE = {"ttl_max_s": LONG_TTL_S}
TIMEOUT_S = 30.0
INTERRUPTS = 10_000
DEADLINE, FAILED = 0, 8
"""Offsets in the memory that is shared with the application; microseconds, monotonic."""

APPLICATION = """
import ctypes, gc, json, mmap, os, signal, struct, sys, time, wheelwire
driver, options, failure, path = sys.argv[1], json.loads(sys.argv[2]), sys.argv[3], sys.argv[4]
TTL_US = int(sys.argv[5])
memory = mmap.mmap(os.open(path, os.O_RDWR), mmap.PAGESIZE)
now_us = lambda: time.monotonic_ns() // 1000
note = lambda offset, value: struct.pack_into("q", memory, offset, value)
libc = ctypes.CDLL(None)
asked = []
signal.signal(signal.SIGUSR1, lambda *_: asked.append(True))
if "pwm_directory" in options:
    from pathlib import Path
    options["pwm_directory"] = Path(options["pwm_directory"])

robot = wheelwire.open_driver(driver, **options)
print("open", flush=True)
while not asked:
    note(DEADLINE, now_us() + TTL_US)
    try:
        robot.set_velocity(0.25, 0.0, ttl=TTL_US / 1e6)
    except wheelwire.WheelwireError:
        pass
    time.sleep(0.02)
note(FAILED, now_us())
if failure == "exit":
    os._exit(0)
elif failure == "fork":
    if libc.fork() == 0:
        libc.sleep(2)
        libc._exit(0)
    os.kill(os.getpid(), signal.SIGKILL)
elif failure == "close":
    robot.shutdown()
elif failure == "forgotten":
    del robot
    gc.collect()
time.sleep(60)
"""

Injection = Callable[["Application"], None]


def now_us() -> int:
    return time.monotonic_ns() // 1000


class Application:
    """A process that drives until it fails."""

    def __init__(
        self, driver: str, options: dict[str, Any], failure: str, directory: Path, ttl_s: float
    ) -> None:
        path = directory / "memory"
        path.write_bytes(bytes(mmap.PAGESIZE))
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), mmap.PAGESIZE)
        numbers = f"DEADLINE, FAILED = {DEADLINE}, {FAILED}\n"
        log = (directory / "log").open("wb")
        arguments = (driver, json.dumps(options), failure, str(path), str(round(ttl_s * 1e6)))
        self.process = subprocess.Popen(
            [sys.executable, "-c", numbers + APPLICATION, *arguments],
            stdout=subprocess.PIPE,
            stderr=log,
            start_new_session=True,
            preexec_fn=interruptible,
        )
        log.close()
        assert self.process.stdout
        line = self.process.stdout.readline()
        assert line == b"open\n", (directory / "log").read_text()
        self.child = next(iter(children(self.process.pid)), 0)
        """The process that it started: a guard or the simulator; 0 if there is none."""

    def word(self, offset: int) -> int:
        return int(struct.unpack_from("q", self._memory, offset)[0])

    def close(self) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        assert self.process.stdout
        self.process.stdout.close()


def _send(number: int) -> Injection:
    return lambda application: application.process.send_signal(number)


def _interrupt_often(application: Application) -> None:
    with suppress(ProcessLookupError):
        for _ in range(INTERRUPTS):
            os.killpg(application.process.pid, signal.SIGINT)


def _send_to_core(number: int) -> Injection:
    def inject(application: Application) -> None:
        (core,) = children(application.child)
        os.kill(core, number)

    return inject


APPLICATION_FAILURES: dict[str, tuple[str, Injection]] = {
    "killed (SIGKILL)": ("", _send(signal.SIGKILL)),
    "stopped (SIGSTOP)": ("", _send(signal.SIGSTOP)),
    "killed, a fork holds the socket": ("fork", _send(signal.SIGUSR1)),
    "exit without close": ("exit", _send(signal.SIGUSR1)),
    "closed": ("close", _send(signal.SIGUSR1)),
    "forgotten (garbage collection)": ("forgotten", _send(signal.SIGUSR1)),
    "hang": ("hang", _send(signal.SIGUSR1)),
    f"{INTERRUPTS} SIGINTs": ("", _interrupt_often),
}
CORE_FAILURES: dict[str, Injection] = {
    "core killed": _send_to_core(signal.SIGKILL),
    "core stopped": _send_to_core(signal.SIGSTOP),
    "guard killed": lambda application: os.kill(application.child, signal.SIGKILL),
}
UNDETECTED_FAILURES = ("stopped (SIGSTOP)", "hang")
"""The robot's process does not notice these: only the setpoint's deadline stops the wheels."""


@dataclass(frozen=True)
class FailureTimes:
    """One run; times in microseconds.

    Attributes:
        failure_to_removed_us: From the failure to the drive's removal.
        late_us: From the deadline of the last setpoint to the drive's removal; below 0 if the
            drive was removed before it.
        ended_us: From the failure to the end of the process that moves the pins; None where it goes
            on, because its application does.
    """

    failure_to_removed_us: int
    late_us: int
    ended_us: int | None


class ObservedRobot(ABC):
    """A robot, how an application drives it, and how the test sees its motors."""

    driver: str
    options: dict[str, Any]

    @abstractmethod
    def is_driven(self) -> bool:
        """Whether a motor is switched on."""

    @abstractmethod
    def removed_us(self) -> int:
        """When the drive was last removed."""

    def is_up_to_speed(self, application: Application) -> bool:
        """Whether the robot has reached its speed."""
        del application
        return self.is_driven()


class StandInRobot(ObservedRobot):
    """On a stand-in for the hardware."""

    def __init__(self, driver: str, stand_in: StandIn, options: dict[str, Any]) -> None:
        self.driver = driver
        self.options = options
        self._stand_in = stand_in
        stand_in.set_realtime()

    def is_driven(self) -> bool:
        return bool(self._stand_in.truth()["driven"])

    def removed_us(self) -> int:
        return int(self._stand_in.truth()["driven_changed_us"])


class SerialRobot(ObservedRobot):
    """On the simulated ESP32 behind a pseudo-terminal."""

    driver = "serial"

    def __init__(self, simulator: Simulator) -> None:
        self.options = {"port": simulator.port, "connect_timeout": 30}
        self._simulator = simulator
        self._removed_us = 0

    def is_driven(self) -> bool:
        driven = bool(self._simulator.get("drive_on"))
        for state in self._simulator.take_states():
            if state.drive_changed and not state.drive_on:
                self._removed_us = state.host_us
        return driven

    def removed_us(self) -> int:
        return wait_until(lambda: 0 if self.is_driven() else self._removed_us)


class MockRobot(ObservedRobot):
    """The mock driver; its simulator's output is copied to a file."""

    driver = "mock"

    def __init__(self, truth: Path) -> None:
        self.options = {"parameters": dict(LONG_LIFE)}
        self._truth = truth
        self._child: int | None = None
        self._ended_us = 0

    def is_up_to_speed(self, application: Application) -> bool:
        self._child = self._child or os.pidfd_open(application.child)
        return self.is_driven()

    def is_driven(self) -> bool:
        if self._child is not None and select.select([self._child], [], [], 0)[0]:
            self._ended_us = self._ended_us or now_us()
            return False
        last = self._last_change()
        return bool(last and last["drive_on"])

    def removed_us(self) -> int:
        last = self._last_change()
        return int(last["host_us"]) if last and not last["drive_on"] else self._ended_us

    def _last_change(self) -> dict[str, Any] | None:
        lines = self._truth.read_text().splitlines() if self._truth.exists() else []
        changes = [line for line in lines if '"drive"' in line and line.endswith("}")]
        return json.loads(changes[-1]) if changes else None


TEE = """#!/bin/bash
exec {program} --truth-hz=1 "$@" > >(exec tee -a {truth})
"""


@contextmanager
def open_robot(name: str, directory: Path, core_timeout_ms: int | None) -> Iterator[ObservedRobot]:
    """`serial`, `l298n` (kernel PWM), `l298n, software PWM`, `pigpio` or `mock`."""
    tolerant: dict[str, Any] = {"parameters": {"overrun_limit_us": 1e6, **LONG_LIFE}}
    if core_timeout_ms is not None:
        tolerant["core_timeout_ms"] = core_timeout_ms
    if name == "serial":
        with Simulator(truth_hz=1.0) as simulator:
            yield SerialRobot(simulator)
    elif name == "pigpio":
        with PigpioProcess() as daemon:
            options = {"host": "127.0.0.1", "port": daemon.port, **tolerant}
            yield StandInRobot("pigpio", daemon, options)
    elif name == "mock":
        program = directory / "simulator"
        truth = directory / "truth"
        names = {"truth": quote(str(truth)), "program": quote(str(find_simulator()))}
        program.write_text(TEE.format(**names))
        program.chmod(0o755)
        with mock.patch.dict(os.environ, {ENVIRONMENT: str(program)}):
            yield MockRobot(truth)
    else:
        with GpioChip(directory, kernel_pwm="software" not in name) as chip:
            options = {"pwm_directory": str(chip.pwm_directory), **tolerant}
            with mock.patch.dict(os.environ, chip.environment):
                yield StandInRobot("l298n", chip, options)


def time_failure(
    driver: str,
    failure: str,
    phase_s: float = 0.0,
    core_timeout_ms: int | None = None,
    ttl_s: float = TTL_S,
) -> FailureTimes:
    """Drive, inject the failure `phase_s` later, and measure.

    A simulated ESP32 takes no setpoint with a life of more than a second.
    """
    behaviour, inject = APPLICATION_FAILURES.get(failure) or ("", CORE_FAILURES[failure])
    # In memory, as /sys is: a disk would hold the core up.
    with folder_in_memory() as folder, open_robot(driver, folder, core_timeout_ms) as robot:
        application = Application(robot.driver, robot.options, behaviour, folder, ttl_s)
        try:
            wait_until(lambda: robot.is_up_to_speed(application), what="the drive")
            time.sleep(0.2 + phase_s)
            ends = failure not in UNDETECTED_FAILURES and robot.driver != "serial"
            child = os.pidfd_open(application.child) if ends else None
            failed_us = now_us()
            inject(application)
            wait_until(lambda: not robot.is_driven(), what="the end of the drive")
            removed_us = robot.removed_us()
            ended_us = None if child is None else _end(child) - failed_us
        finally:
            application.close()
        failed_us = application.word(FAILED) or failed_us
        return FailureTimes(
            removed_us - failed_us, removed_us - application.word(DEADLINE), ended_us
        )


def _end(process: int) -> int:
    assert select.select([process], [], [], TIMEOUT_S)[0], "the process goes on"
    os.close(process)
    return now_us()
