"""From an edge at a sensor to the removed drive, beside the e-stop contact: `make bench`."""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, output_folder, spread, table, table_of_targets
from wheelwire.drivers.mock import MockDriver
from wheelwire.simulation.libfwsim import FwSim
from wheelwire.tools.files.board import board_mapping, load_board, parse_board

INPUTS = {
    "bumper_front": {"pin": 36, "pull": "external"},
    "cliff_front": {"pin": 39, "pull": "external"},
    "stage_fault": {"pin": 34, "pull": "external"},
}
SENSORS = {
    "estop_open": "the e-stop contact",
    "bumper.front": "a bumper",
    "cliff.front": "a cliff sensor",
    "stage_fault": "a power stage's fault output",
}
EDGES = 1000
SPEED_MPS = 0.2

METHOD = f"""\
The simulated robot drives at {SPEED_MPS} m/s, in virtual time: the same at every run. {EDGES} edges
at each input's GPIO, at random moments of the control period; from the edge to the moment at which
no winding is driven.
"""


def latencies(robot: MockDriver, variable: str, random: Random) -> list[float]:
    """Microseconds from each edge at a random moment of the control period to no drive."""
    found = []
    simulator = robot.simulator
    assert isinstance(simulator, FwSim)
    for _ in range(EDGES):
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
    output_folder(__doc__)
    board = parse_board({**board_mapping(load_board("l298n")), "inputs": INPUTS})
    random = Random(1)
    with MockDriver(realtime=False) as robot:
        robot.board.take_up(board)
        period_us = 1e6 / robot.parameters["control_rate_hz"]
        found = {variable: latencies(robot, variable, random) for variable in SENSORS}
    rows = [
        [SENSORS[variable], f"{len(times)}", *(f"{us:.0f} us" for us in spread(times))]
        for variable, times in found.items()
    ]
    longest = max(max(times) for times in found.values())
    target = Target(
        "the longest",
        f"{longest:.0f} us",
        f"a control period, {period_us:.0f} us",
        longest <= period_us,
    )
    sys.stdout.write(
        f"## From an edge to no drive\n\n{METHOD}\n"
        f"{table(('edge at', 'edges', 'p50', 'p99', 'longest'), rows)}\n"
        f"{table_of_targets([target])}"
    )
    return 0 if target.reached else 1


if __name__ == "__main__":
    sys.exit(main())
