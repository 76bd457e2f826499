"""Latency.

From the call of `set_velocity` at rest until a bridge drives, {COMMANDS} times, in us (p50, p99,
longest); in real time, with 1000 control steps a second. The idle link carries {IDLE_HZ} states a
second, full load is {FULL_HZ} and requests without pause.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from queue import SimpleQueue
from typing import TypeAlias

from harness import Report, run, spread
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire_protocol.codes import StopMode

IDLE_HZ, FULL_HZ = 10, 1000
STEP_S = 1e-3
COMMANDS = 1500
TIMEOUT_S = 5.0

States: TypeAlias = "SimpleQueue[TrueState]"


@contextmanager
def full_load(robot: SerialDriver) -> Iterator[None]:
    """A thread that sends one request after the other."""
    end = threading.Event()

    def ask() -> None:
        while not end.is_set():
            robot.device_counters()

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()


def to_pwm_us(robot: SerialDriver, states: States) -> list[float]:
    """The latencies from commands to the drive."""
    # A bridge that brakes first lets go for a step.
    robot.parameters.set("stop_mode", StopMode.COAST)
    found = []
    for _ in range(COMMANDS):
        # Random over a whole step, so that commands meet every phase of the control loop.
        time.sleep(random.uniform(0.5, 1.5) * STEP_S)
        begin_us = time.monotonic_ns() / 1000
        robot.set_velocity(0.1, 0.0)
        found.append(_next_change(states).host_us - begin_us)
        robot.stop()
        # Until the bridges are off: a command to a robot that drives would change nothing.
        _next_change(states)
    return found


def _next_change(states: States) -> TrueState:
    while not (state := states.get(timeout=TIMEOUT_S)).drive_changed:
        pass
    return state


def main(report: Report) -> None:
    """Measure and print."""
    rows = []
    for load, rate_hz, loaded in (
        ("idle link", IDLE_HZ, nullcontext),
        ("full load", FULL_HZ, full_load),
    ):
        states: States = SimpleQueue()
        with (
            # Changes of the drive are reported when they happen, at any rate of the true states.
            Simulator(truth_hz=1.0, on_state=states.put) as simulator,
            SerialDriver(simulator.port, stream_rate_hz=rate_hz) as robot,
            loaded(robot),
        ):
            cells = " | ".join(f"{us:.0f}" for us in spread(to_pwm_us(robot, states)))
        rows.append(f"{load} | {cells}")
    report.items(rows)


run(main)
