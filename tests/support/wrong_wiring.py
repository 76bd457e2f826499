"""A simulated robot that is wired in another way than a new board says, and what is true of it."""

from __future__ import annotations

from wheelwire import open_driver
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.plant import load_plant
from wheelwire.tools.setup.setup import CHANGED

WRONG = {"encoders_swapped": 1, "right.motor_reversed": 1, "left.encoder_reversed": 1}
SETTINGS = {**load_plant("tt-1-48").settings, "wheels_free": 1, **WRONG}
FOUND = {
    "motors_swapped": 0,
    "encoders_swapped": 1,
    "left_motor_inverted": 0,
    "right_motor_inverted": 1,
    "left_encoder_inverted": 1,
    "right_encoder_inverted": 0,
    "counts_per_revolution": 2496,
    "wheel_radius": 0.0325,
    "wheel_separation": 0.14,
}


def values(simulator: Simulator) -> dict[str, float]:
    """As the robot has them after a reset."""
    simulator.reset()
    with open_driver("serial", port=simulator.port) as robot:
        return {name: robot.parameters[name] for name in CHANGED}
