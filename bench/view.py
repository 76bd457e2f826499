"""The view on the whole screen.

`wheelwire monitor` on a pseudo-terminal, with {STREAM_HZ} states a second, driven by a key held
for {MEASURED_S:.0f} s: CPU of a core while it looks, while it drives, and attached to a program
that drives. Beside it the least that it stands on: an application of Textual that draws its whole
screen as often, and a program that reads {LOOKS_HZ} samples a second of that stream.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

from harness import Report, run
from support.load import load_while, read_for
from support.processes import cpu_s
from support.typing_terminal import TypingTerminal
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator

STREAM_HZ = 1000
SETTLING_S = 5.0
MEASURED_S = 20.0
LOOKS_HZ = 20
TIMES = 1.5
"""The view's CPU at most, as a multiple of what it stands on."""
PEER = (sys.executable, str(Path(__file__).with_name("screen_peer.py")))
SIZES = ((80, 24), (200, 60))


def share_of(terminal: TypingTerminal, use: Callable[[float], None]) -> float:
    """CPU of the view while it is used for a time, in percent of one core."""
    begin, cpu_before = time.monotonic(), cpu_s([terminal.process.pid])
    use(MEASURED_S)
    assert terminal.process.poll() is None, terminal.output[-2000:]
    return 100 * (cpu_s([terminal.process.pid]) - cpu_before) / (time.monotonic() - begin)


def measured(simulator: Simulator, size: tuple[int, int], key: bytes) -> float:
    """The share of a view that drives with `w`, or only looks with any other key."""
    with TypingTerminal("monitor", simulator.port, size=size) as terminal:
        terminal.wait_for("ticks")
        time.sleep(SETTLING_S)
        if key == b"w":
            terminal.press(b"t")
            terminal.wait_for("y drives")
            terminal.press(b"y")
        share = share_of(terminal, lambda seconds: terminal.hold(key, seconds))
        terminal.press(b"q")
        terminal.wait()
    return share


def beside(simulator: Simulator, size: tuple[int, int]) -> float:
    """The share of a view that is attached to a program that drives 50 times a second."""
    with (
        SerialDriver(simulator.port) as robot,
        TypingTerminal("monitor", simulator.port, size=size) as terminal,
    ):

        def drive(seconds: float) -> None:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                robot.set_velocity(0.2, 0.0, ttl=0.3)
                time.sleep(0.02)

        terminal.wait_for("ticks")
        drive(SETTLING_S)
        return share_of(terminal, drive)


def drawing(size: tuple[int, int]) -> float:
    """The share of the application that only draws."""
    with TypingTerminal(program=PEER, size=size) as terminal:
        time.sleep(SETTLING_S)
        share = share_of(terminal, time.sleep)
        terminal.press(b"q")
        terminal.wait()
    return share


def main(report: Report) -> None:
    """Print the list."""
    rows, worst = [], 0.0
    with Simulator() as simulator:
        with SerialDriver(simulator.port) as robot:
            robot.parameters.set("stream_rate_hz", STREAM_HZ)
        with SerialDriver(simulator.port) as robot:
            reads = 100 * load_while(lambda: read_for(MEASURED_S, robot, LOOKS_HZ)).cpu
        for size in SIZES:
            looks, drives = (measured(simulator, size, key) for key in (b"x", b"w"))
            shares = looks, drives, beside(simulator, size)
            draws = drawing(size)
            worst = max(worst, max(shares) / (draws + reads))
            cells = " | ".join(f"{share:.1f}%" for share in (*shares, draws, reads))
            rows.append(f"{size[0]} x {size[1]} | {cells}")
    report.say("Columns x rows: looks, drives, attached; only draws, only reads.")
    report.items(rows)
    report.at_most(f"CPU at {STREAM_HZ} Hz / of drawing and reading, worst", worst, TIMES)


run(main)
