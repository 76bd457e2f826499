"""Hosts that drive a simulated robot from a separate process, and their failures."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from wheelwire.connect import RECORD_VARIABLE
from wheelwire.drivers.attached import AttachedDriver
from wheelwire.simulation.bad_line import ImpairedLine, LineProfile
from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire_protocol.framing import Encoder

from .attached import holder_of
from .processes import interruptible
from .stop_times import (
    SPEED_MPS,
    TTL_S,
    StopTime,
    babble,
    corrupt_everything,
    frames_of_wrong_schema,
)
from .waiting import wait_until

TIMEOUT_S = 30.0
TRUTH_HZ = 200.0

COMMANDING = """
import signal, sys, time, wheelwire
signal.signal(signal.SIGUSR1, lambda *_: time.sleep(3600))
with wheelwire.open_driver("serial", port=sys.argv[1], connect_timeout=30) as robot:
    while True:
        try:
            robot.set_velocity({speed}, 0.0, ttl={ttl})
        except wheelwire.LinkLost:
            pass
        time.sleep(0.02)
"""
HANG = signal.SIGUSR1
"""Signal that makes the main thread sleep; the link's thread keeps pinging."""

Failure = Callable[[Simulator, "subprocess.Popen[bytes]"], object]


@contextmanager
def host(simulator: Simulator, *, watched: bool = False) -> Iterator[subprocess.Popen[bytes]]:
    """A process that drives the simulated robot; killed at the end.

    Args:
        simulator: The robot.
        watched: Whether the process records its day, and another one is attached to it.
    """
    code = COMMANDING.format(ttl=TTL_S, speed=SPEED_MPS)
    command = [sys.executable, "-c", code, simulator.port]
    with TemporaryDirectory() as folder:
        recording = {RECORD_VARIABLE: folder} if watched else {}
        process = subprocess.Popen(
            command, preexec_fn=interruptible, env={**os.environ, **recording}
        )
        try:
            with AttachedDriver(holder_of(simulator.port)) if watched else nullcontext():
                yield process
            assert not watched or list(Path(folder).glob("*.mcap"))
        finally:
            process.kill()
            process.wait()


def wait(simulator: Simulator, condition: Callable[[TrueState], bool]) -> TrueState:
    """The first true state from now on that fulfils `condition`."""
    return wait_until(lambda: next(filter(condition, simulator.take_states()), None), TIMEOUT_S)


def at_speed(state: TrueState) -> bool:
    """Whether the robot is nearly as fast as commanded."""
    return state.left_mps > 0.8 * SPEED_MPS


def stopped(state: TrueState) -> bool:
    """Whether the robot is neither driven nor moving."""
    return not state.drive_on and state.stands_still


def take_port_with_wrong_schema(simulator: Simulator, process: subprocess.Popen[bytes]) -> None:
    """Kill the host; one of another release then says hello and sends commands for a second."""
    process.kill()
    process.wait()
    encoder = Encoder()
    port = os.open(simulator.port, os.O_RDWR | os.O_NOCTTY)
    try:
        for number in range(1, 51):
            os.write(port, frames_of_wrong_schema(encoder, number))
            time.sleep(0.02)
    finally:
        os.close(port)


FAILURES: dict[str, Failure] = {
    "host killed": lambda _, process: process.send_signal(signal.SIGKILL),
    "host frozen": lambda _, process: process.send_signal(signal.SIGSTOP),
    "cable pulled": lambda simulator, _: simulator.unplug(),
    "every byte corrupted": lambda simulator, _: corrupt_everything(_line_of(simulator)),
    "babbling line": lambda simulator, _: babble(_line_of(simulator)),
    "pings, no commands": lambda _, process: process.send_signal(HANG),
    "host of a wrong schema": take_port_with_wrong_schema,
}


@dataclass(frozen=True)
class RealStop:
    """A stop in real time; `at_failure` is the first true state reported after the failure."""

    time: StopTime
    at_failure: TrueState
    end: TrueState


def stop(simulator: Simulator, process: subprocess.Popen[bytes], failure: Failure) -> RealStop:
    """Wait for speed, inject the failure, and measure, in the device's clock."""
    wait(simulator, at_speed)
    simulator.take_states()
    before = wait(simulator, lambda _: True)
    failure(simulator, process)
    end = wait(simulator, lambda state: stopped(state) and state.t_us > before.t_us)
    return RealStop(
        StopTime(
            failure_to_removed_us=end.drive_removed_us - before.device_us,
            late_us=end.drive_removed_us - end.deadline_us,
            removed_to_standstill_us=end.standstill_us - end.drive_removed_us,
            distance_m=end.distance_m - before.distance_m,
        ),
        before,
        end,
    )


def reset_while_driving(simulator: Simulator, process: subprocess.Popen[bytes]) -> StopTime:
    """Kill the host, so that nobody sends commands, and reset the device before the deadline."""
    wait(simulator, at_speed)
    process.kill()
    process.wait()
    boot_id = simulator.reset()
    reset = wait(simulator, lambda state: state.boot_id == boot_id)
    assert not reset.drive_on
    end = wait(simulator, stopped)
    return StopTime(
        failure_to_removed_us=end.drive_removed_us,
        late_us=None,
        removed_to_standstill_us=end.standstill_us - end.drive_removed_us,
        distance_m=end.distance_m - reset.distance_m,
    )


def real_stop_time(name: str, seed: int, *, watched: bool = False) -> StopTime:
    """One stop with a robot and a host of its own; `watched` as for `host`."""
    with (
        ImpairedSimulator(LineProfile(seed=seed), truth_hz=TRUTH_HZ, seed=seed) as simulator,
        host(simulator, watched=watched) as process,
    ):
        if name == "device reset":
            return reset_while_driving(simulator, process)
        return stop(simulator, process, FAILURES[name]).time


def _line_of(simulator: Simulator) -> ImpairedLine:
    assert isinstance(simulator, ImpairedSimulator)
    return simulator.line
