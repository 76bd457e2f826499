"""From an edge at a sensor to the removed drive, beside the e-stop contact; in virtual time."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from random import Random
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from wheelwire.drivers.mock import MockDriver
from wheelwire.files.board import board_mapping, load_board, parse_board
from wheelwire.simulation.libfwsim import FwSim

INPUTS = {
    "bumper_front": {"pin": 36, "pull": "external"},
    "cliff_front": {"pin": 39, "pull": "external"},
    "stage_fault": {"pin": 34, "pull": "external"},
}
SPEED_MPS = 0.2


def latencies(robot: MockDriver, variable: str, edges: int, random: Random) -> list[float]:
    """Microseconds from each edge at a random moment of the control period to no drive."""
    found = []
    simulator = robot.simulator
    assert isinstance(simulator, FwSim)
    for _ in range(edges):
        robot.clear_estop()
        robot.clear_fault()
        robot.set_velocity(0.0, 0.0)
        robot.advance(0.06)
        robot.set_velocity(SPEED_MPS, SPEED_MPS)
        robot.advance(0.1)
        simulator.advance_us(random.randrange(1000))
        assert simulator.get("drive_on") == 1.0, variable
        began_us = simulator.get("device_us")
        simulator.set(variable, 1)
        robot.advance(0.01)
        assert simulator.get("drive_on") == 0.0, variable
        found.append(simulator.get("drive_removed_us") - began_us)
        simulator.set(variable, 0)
        robot.advance(0.08)  # A sensor is free once it was so for 50 ms.
    return found


def main() -> int:
    """Print the table; returns 1 if an edge took more than a control period."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edges", type=int, default=1000, help="of each sensor")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    board = parse_board({**board_mapping(load_board("l298n")), "inputs": INPUTS})
    random = Random(arguments.seed)
    rows, late = [], 0
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "store"
        with MockDriver(store=store, realtime=True) as robot:
            robot.board.take_up(board)
        robot = MockDriver(store=store, realtime=False)
        period_us = 1e6 / robot.parameters["control_rate_hz"]
        for variable in ("estop_open", "bumper.front", "cliff.front", "stage_fault"):
            found = latencies(robot, variable, arguments.edges, random)
            late += sum(us > period_us for us in found)
            rows.append(
                [variable, str(len(found)), f"{median(found):.0f} us", f"{max(found):.0f} us"]
            )
    sys.stdout.write(table(("edge at", "edges", "median", "longest"), rows))
    sys.stdout.write(f"\na control period is {period_us:.0f} us; {late} edges took more\n")
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
