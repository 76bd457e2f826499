"""The processor that the view on the whole screen takes at 1 kHz: `make bench`, or this file."""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, output_folder, table, table_of_targets
from support.processes import cpu_s
from support.typing_terminal import TypingTerminal
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator

STREAM_HZ = 1000
SETTLING_S = 5.0
MEASURED_S = 20.0
LIMIT = 0.15
SIZES = ((80, 24), (200, 60))
METHOD = f"""\
`wheelwire monitor` on a pseudo-terminal shows the firmware's core on another one, which sends
{STREAM_HZ} states a second, and is driven by a key that is held for {MEASURED_S:.0f} s. *Beside*
means attached to a program that drives the same robot. CPU is the view's process by the kernel's
accounts, of one core, with the link that it holds.
"""


def share_of(terminal: TypingTerminal, key: bytes) -> float:
    """CPU of the view while a key is held, as a part of one core."""
    begin, cpu_before = time.monotonic(), cpu_s([terminal.process.pid])
    terminal.hold(key, MEASURED_S)
    assert terminal.process.poll() is None, terminal.output[-2000:]
    return (cpu_s([terminal.process.pid]) - cpu_before) / (time.monotonic() - begin)


def measured(simulator: Simulator, size: tuple[int, int], key: bytes) -> float:
    """The share of a view that drives with `w`, or only looks with any other key."""
    with TypingTerminal("monitor", simulator.port, size=size) as terminal:
        terminal.wait_for("ticks")
        time.sleep(SETTLING_S)
        if key == b"w":
            terminal.press(b"t")
            terminal.wait_for("y drives")
            terminal.press(b"y")
        share = share_of(terminal, key)
        terminal.press(b"q")
        terminal.wait()
    return share


def beside(simulator: Simulator, size: tuple[int, int]) -> float:
    """The share of a view that is attached to a program that drives 50 times a second."""
    with (
        SerialDriver(simulator.port) as robot,
        TypingTerminal("monitor", simulator.port, size=size) as terminal,
    ):
        terminal.wait_for("ticks")
        begin, cpu_before = time.monotonic(), 0.0
        while (now := time.monotonic()) < begin + SETTLING_S + MEASURED_S:
            robot.set_velocity(0.2, 0.0, ttl=0.3)
            if now >= begin + SETTLING_S and not cpu_before:
                begin_s, cpu_before = now, cpu_s([terminal.process.pid])
            time.sleep(0.02)
        return (cpu_s([terminal.process.pid]) - cpu_before) / (time.monotonic() - begin_s)


def main() -> int:
    """Print the tables; returns 1 if the target is missed."""
    output_folder(__doc__)
    rows, shares = [], []
    with Simulator() as simulator:
        with SerialDriver(simulator.port) as robot:
            robot.parameters.set("stream_rate_hz", STREAM_HZ)
        for size in SIZES:
            looks = measured(simulator, size, b"x")
            drives = measured(simulator, size, b"w")
            attached = beside(simulator, size)
            shares += [looks, drives, attached]
            cells = [f"{share:.1%}" for share in (looks, drives, attached)]
            rows.append([f"{size[0]} x {size[1]}", *cells])
    sys.stdout.write(f"## The view on the whole screen\n\n{METHOD}\n")
    sys.stdout.write(table(("screen", "looks", "drives", "beside"), rows) + "\n")
    worst = max(shares)
    target = Target(
        f"CPU at {STREAM_HZ} Hz, worst", f"{worst:.1%}", f"<= {LIMIT:.0%}", worst <= LIMIT
    )
    sys.stdout.write(table_of_targets([target]))
    return 0 if target.reached else 1


if __name__ == "__main__":
    sys.exit(main())
