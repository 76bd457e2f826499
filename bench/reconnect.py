"""Reconnection.

From an unplugging or a reset to the first sample that was latched after it, in real time.
"""

from __future__ import annotations

from pathlib import Path

from harness import Report, run, spread
from support.reconnect import AIM_S, TIMEOUT_S, after_reset, after_unplug
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.statistics import quantile
from wheelwire.simulation.bad_line import Impairment, LineProfile
from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.simulator import Simulator

CORRUPT = Impairment(corrupt=0.01)


def other_names(folder: Path, cycles: int) -> list[float]:
    """Seconds after the port came back under a new name each time."""
    with Simulator() as simulator:
        (folder / "tty0").symlink_to(simulator.port)
        # Opened once by its name, to read the id. From then on the id finds it.
        with SerialDriver(str(folder / "tty0")) as robot:
            board_id = robot.info.device.board_id
        with SerialDriver(str(folder / "tty*"), board_id=board_id) as robot:
            names = [folder / f"tty{number}" for number in range(1, cycles + 1)]
            return [after_unplug(simulator, robot, name) for name in names]


def main(report: Report, *, cycles: int = 100) -> None:
    """Print the table; reconnecting must not take too long."""
    with (
        Simulator(link=report.scratch / "robot") as simulator,
        SerialDriver(simulator.port) as robot,
    ):
        boot_s = simulator.get("boot_time_us") / 1e6
        found = {"the port's return": [after_unplug(simulator, robot) for _ in range(cycles)]}
        reset = [after_reset(simulator, robot) - boot_s for _ in range(cycles)]
    found["... under another name, by board_id"] = other_names(report.scratch, cycles)
    found[f"a reset, less the {boot_s * 1e3:g} ms of boot"] = reset
    with (
        ImpairedSimulator(LineProfile(CORRUPT, CORRUPT)) as simulator,
        SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot,
    ):
        corrupted = [after_reset(simulator, robot) - boot_s for _ in range(cycles)]
        found["... with 1 % of the bytes corrupted"] = corrupted
    rows = [
        " | ".join([name, *(f"{number * 1e3:.0f} ms" for number in spread(values))])
        for name, values in found.items()
    ]
    report.table(f"to the first fresh sample, {cycles} each | p50 | p99 | max", rows)
    returned = quantile(found["the port's return"], 0.99)
    report.at_most("p99 of the port's return", returned * 1e3, AIM_S * 1e3, " ms")


run(main, log_level="ERROR")
