"""Latency.

In us (p50, p99, longest), in real time, with 1000 control steps a second. *To the PWM*: from the
call of `set_velocity` at rest until a bridge drives, {COMMANDS} times. *Late*: {STEPS} control
steps, against the earliest. The idle link carries {IDLE_HZ} states a second, full load is {FULL_HZ}
and requests without pause.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from itertools import pairwise
from queue import SimpleQueue
from typing import TypeAlias

from harness import Report, run, spread
from support.raw import RawHost
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.types import Ack, SetStreamRate, SetWheelVelocity, WheelState

IDLE_HZ, FULL_HZ = 10, 1000
BAUD = 921_600
STEP_US = 1000
COMMANDS = 1500
STEPS = 5000
VIRTUAL_MS = 5000
SETPOINTS_PER_MS = 2
LIFE_US = 500_000
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
        time.sleep(random.uniform(0.5, 1.5) * STEP_US * 1e-6)
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


def late_us(_robot: SerialDriver, states: States) -> list[float]:
    """Delay of each step relative to the earliest one, measured against simulated time."""
    taken = [states.get(timeout=TIMEOUT_S) for _ in range(STEPS)]
    delays = [state.host_us - state.t_us for state in taken]
    # The two clocks do not begin at the same moment: the earliest step is taken as punctual.
    return [float(delay - min(delays)) for delay in delays]


# Changes of the drive are reported when they happen, at any rate of the true states.
MEASURES: tuple[tuple[str, Callable[[SerialDriver, States], list[float]], float], ...] = (
    ("to the PWM", to_pwm_us, 1.0),
    ("late", late_us, 1e6 / STEP_US),
)
LOADS = (("idle link", IDLE_HZ, nullcontext), ("full load", FULL_HZ, full_load))


def in_virtual_time() -> str:
    """The jitter of the steps while the line is full in both directions."""
    host = RawHost()
    host.sim.set("baud_rate", BAUD)
    host.open()
    host.ask(SetStreamRate(host.session_id, 1, FULL_HZ), Ack)
    # From here on each step has a state; their times are compared below.
    host.received.clear()
    sent = 0
    for number in range(VIRTUAL_MS):
        life = host.device_us + LIFE_US
        first = 1 + number * SETPOINTS_PER_MS
        setpoints = [
            SetWheelVelocity(host.session_id, first + index, life, 0.1, 0.1)
            for index in range(SETPOINTS_PER_MS)
        ]
        sent += sum(len(host.encoder.encode(setpoint)) for setpoint in setpoints)
        host.send(*setpoints)
        host.run_ms(1)
    states = host.of(WheelState)
    gaps = [b.t_us - a.t_us for a, b in pairwise(states)]
    # 10 bits a byte, with the start bit and the stop bit.
    filled = sent / VIRTUAL_MS * 1e3 * 10 / BAUD
    return (
        f"In virtual time, {len(states)} control steps on a line of {BAUD} baud, each with a state "
        f"to the host and {SETPOINTS_PER_MS} setpoints from it, {filled:.0%} of what it carries: "
        f"{min(gaps)} to {max(gaps)} us from one step to the next on the device's clock, "
        f"{states[-1].overruns} overruns."
    )


def main(report: Report) -> None:
    """Measure and print."""
    rows = []
    for what, measure, truth_hz in MEASURES:
        for load, rate_hz, loaded in LOADS:
            states: States = SimpleQueue()
            with (
                Simulator(truth_hz=truth_hz, on_state=states.put) as simulator,
                SerialDriver(simulator.port, stream_rate_hz=rate_hz) as robot,
                loaded(robot),
            ):
                cells = " | ".join(f"{us:.0f}" for us in spread(measure(robot, states)))
            rows.append(f"{what}, {load} | {cells}")
    report.items(rows)
    report.say(in_virtual_time())


run(main)
