"""From an edge to no drive.

Driving at {SPEED_MPS} m/s, in virtual time: {EDGES} edges at each input's GPIO, at random moments
of the control period, until no winding is driven (p50, p99, longest).
"""

from __future__ import annotations

from random import Random

from harness import Report, run, spread
from wheelwire.drivers.mock import MockDriver
from wheelwire.simulation.libfwsim import FwSim
from wheelwire.tools.files.board import board_mapping, load_board, parse_board

PINS = {"bumper_front": 36, "cliff_front": 39, "stage_fault": 34}
INPUTS = {name: {"pin": pin, "pull": "external"} for name, pin in PINS.items()}
SENSORS = {
    "estop_open": "the e-stop contact",
    "bumper.front": "a bumper",
    "cliff.front": "a cliff sensor",
    "stage_fault": "a power stage's fault output",
}
EDGES = 1000
SPEED_MPS = 0.2


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


def main(report: Report) -> None:
    """Print the table; no edge may take more than a control period."""
    board = parse_board({**board_mapping(load_board("l298n")), "inputs": INPUTS})
    random = Random(1)
    with MockDriver(realtime=False) as robot:
        robot.board.take_up(board)
        period_us = 1e6 / robot.parameters["control_rate_hz"]
        found = {variable: latencies(robot, variable, random) for variable in SENSORS}
    rows = [
        " | ".join([SENSORS[name], *(f"{us:.0f} us" for us in spread(times))])
        for name, times in found.items()
    ]
    report.items(rows)
    longest_us = max(max(times) for times in found.values())
    what = f"a control period, {period_us:.0f} us"
    report.target("the longest", f"{longest_us:.0f} us", what, longest_us <= period_us)


run(main)
