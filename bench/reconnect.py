"""Time to reconnect after an unplugging or a reset, in real time: `make reliability`."""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import spread, table
from support.reconnect import (
    AIM_S,
    TIMEOUT_S,
    after_reset,
    after_return_elsewhere,
    after_unplug,
)
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.info import quantile
from wheelwire.simulation.bad_line import Impairment, LineProfile
from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.simulator import Simulator

CORRUPT = Impairment(corrupt=0.01)


def same_name(folder: Path, cycles: int) -> tuple[list[float], list[float], float]:
    """Seconds after unpluggings, after resets less the boot, and of the boot."""
    with Simulator(link=folder / "robot") as simulator, SerialDriver(simulator.port) as robot:
        boot_s = simulator.get("boot_time_us") / 1e6
        returned = [after_unplug(simulator, robot) for _ in range(cycles)]
        reset = [after_reset(simulator, robot) - boot_s for _ in range(cycles)]
    return returned, reset, boot_s


def other_names(folder: Path, cycles: int) -> list[float]:
    """Seconds after the port came back under a new name each time."""
    with Simulator() as simulator:
        first = folder / "tty0"
        first.symlink_to(simulator.port)
        # Opened once by its name, to learn the id by which it is found from then on.
        with SerialDriver(str(first)) as robot:
            board_id = robot.info.device.board_id
        with SerialDriver(str(folder / "tty*"), board_id=board_id) as robot:
            return [
                after_return_elsewhere(simulator, robot, folder / f"tty{number}")
                for number in range(1, cycles + 1)
            ]


def bad_line(cycles: int) -> list[float]:
    """Seconds after resets, less the boot, with 1 % of the bytes corrupted both ways."""
    with (
        ImpairedSimulator(LineProfile(CORRUPT, CORRUPT)) as simulator,
        SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot,
    ):
        boot_s = simulator.get("boot_time_us") / 1e6
        return [after_reset(simulator, robot) - boot_s for _ in range(cycles)]


def main() -> int:
    """Print the table; fail if reconnecting takes too long."""
    logging.getLogger("wheelwire").setLevel(logging.ERROR)  # each loss is meant
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=100)
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder:
        returned, reset, boot_s = same_name(Path(folder), arguments.cycles)
        elsewhere = other_names(Path(folder), arguments.cycles)
    corrupted = bad_line(arguments.cycles)
    rows = [
        ["the port's return", *_numbers(returned), f"p99 <= {AIM_S * 1e3:g} ms"],
        ["... under another name, by board_id", *_numbers(elsewhere), ""],
        [f"a reset, less the {boot_s * 1e3:g} ms of boot", *_numbers(reset), ""],
        ["... with 1 % of the bytes corrupted", *_numbers(corrupted), ""],
    ]
    header = (f"to the first fresh sample, {arguments.cycles} each", "p50", "p99", "max", "target")
    sys.stdout.write(table(header, rows))
    return int(quantile(returned, 0.99) > AIM_S)


def _numbers(values: list[float]) -> list[str]:
    return [f"{number * 1e3:.0f} ms" for number in spread(values)]


if __name__ == "__main__":
    sys.exit(main())
