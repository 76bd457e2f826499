"""Latency of commands and jitter of the control steps: `make bench`, or this file alone."""

from __future__ import annotations

import random
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, TypeAlias

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import output_folder, table
from support.raw import RawHost
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.info import quantile
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.types import Ack, SetStreamRate, SetWheelVelocity, WheelState

if TYPE_CHECKING:
    from matplotlib.axes import Axes

IDLE_HZ = 10
FULL_HZ = 1000
BAUD = 921_600
STEP_US = 1000
COMMANDS = 1500
STEPS = 5000
VIRTUAL_MS = 5000
SETPOINTS_PER_MS = 2
LIFE_US = 500_000
TIMEOUT_S = 5.0

METHOD = f"""\
The firmware's core steps 1000 times a second, in real time. *To the PWM*: from the call of
`set_velocity` with the bridges off until one drives, by the simulated robot's own account;
{COMMANDS} times, at random points of a control step, whose end is half a step away on average.
*Late*: {STEPS} control steps against the earliest, which is this computer's doing, not the
firmware's. The idle link carries {IDLE_HZ} states a second; under full load it is {FULL_HZ}, and a
thread sends requests as fast as they are answered.
"""

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


def under_loads(
    measure: Callable[[SerialDriver, States], list[float]], truth_hz: float
) -> dict[str, list[float]]:
    """Measure on an idle link and on a busy one; in microseconds."""
    found = {}
    for name, rate_hz, load in (
        ("idle link", IDLE_HZ, nullcontext),
        ("full load", FULL_HZ, full_load),
    ):
        states: States = SimpleQueue()
        with (
            Simulator(truth_hz=truth_hz, on_state=states.put) as simulator,
            SerialDriver(simulator.port, stream_rate_hz=rate_hz) as robot,
            load(robot),
        ):
            found[name] = measure(robot, states)
    return found


def to_pwm_us(robot: SerialDriver, states: States) -> list[float]:
    """The latencies from commands to the drive."""
    robot.parameters.set(
        "stop_mode", StopMode.COAST
    )  # a bridge that brakes first lets go for a step
    return [_one_command_us(robot, states) for _ in range(COMMANDS)]


def _one_command_us(robot: SerialDriver, states: States) -> float:
    # At random over a whole step, so that commands meet every phase of the control loop.
    time.sleep(random.uniform(0.5, 1.5) * STEP_US * 1e-6)
    begin_us = time.monotonic_ns() / 1000
    robot.set_velocity(0.1, 0.0)
    driven = _next_change(states)
    robot.stop()
    # Until the bridges are off: a command to a robot that drives would change nothing.
    _next_change(states)
    return driven.host_us - begin_us


def _next_change(states: States) -> TrueState:
    while True:
        state = states.get(timeout=TIMEOUT_S)
        if state.drive_changed:
            return state


def late_us(_robot: SerialDriver, states: States) -> list[float]:
    """Delay of each step relative to the earliest one, measured against simulated time."""
    taken = [states.get(timeout=TIMEOUT_S) for _ in range(STEPS)]
    delays = [state.host_us - state.t_us for state in taken]
    # The two clocks do not begin at the same moment: the earliest step is taken as punctual.
    return [float(delay - min(delays)) for delay in delays]


def in_virtual_time() -> str:
    """The jitter of the steps while the line is full in both directions."""
    host = RawHost()
    host.sim.set("baud_rate", BAUD)
    host.open()
    host.ask(SetStreamRate(host.session_id, 1, FULL_HZ), Ack)
    # From here on there is a state for each step, whose times are compared below.
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
        f"{states[-1].overruns} overruns. What a step takes on a chip is the firmware's cost.\n"
    )


def draw(commands: Mapping[str, list[float]], steps: Mapping[str, list[float]], file: Path) -> None:
    """The fraction that takes longer than each time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    _draw_tail(left, commands, "from set_velocity to the PWM [ms]")
    _draw_tail(right, steps, "control step late by [ms], real time")
    left.set_ylabel("share that takes longer")
    left.legend()
    figure.savefig(file, dpi=80)


def _draw_tail(axes: Axes, times: Mapping[str, list[float]], label: str) -> None:
    for (name, of_load), colour in zip(times.items(), ("#1b7837", "#762a83"), strict=True):
        shares = [1 - index / len(of_load) for index in range(len(of_load))]
        axes.plot([us / 1000 for us in sorted(of_load)], shares, label=name, color=colour)
    axes.set_yscale("log")
    axes.set_xlabel(label)
    axes.grid(alpha=0.3)


def _rows(what: str, times: Mapping[str, list[float]]) -> list[list[str]]:
    return [
        [f"{what}, {name}", *(f"{us:.0f}" for us in _figures(of_load))]
        for name, of_load in times.items()
    ]


def _figures(times: list[float]) -> tuple[float, float, float]:
    return quantile(times, 0.50), quantile(times, 0.99), max(times)


def main() -> None:
    """Measure, print, draw."""
    folder = output_folder(__doc__)
    # Changes of the drive are reported when they happen, whatever the rate of the true states is.
    commands = under_loads(to_pwm_us, truth_hz=1)
    steps = under_loads(late_us, truth_hz=1e6 / STEP_US)
    draw(commands, steps, folder / "latency.png")
    rows = [*_rows("to the PWM", commands), *_rows("late", steps)]
    sys.stdout.write(f"## Latency\n\n{METHOD}\n")
    sys.stdout.write(f"{table(('[us]', 'p50', 'p99', 'longest'), rows)}\n")
    sys.stdout.write(f"{in_virtual_time()}\n![Latency](latency.png)\n")


if __name__ == "__main__":
    main()
