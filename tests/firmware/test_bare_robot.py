"""The robot behind the stand-ins for a computer's pins: edges as its wheels turn."""

from __future__ import annotations

import time

import numpy as np
import numpy.typing as npt

from support.bare_robot import BareRobot
from support.waiting import wait_until
from wheelwire.pi.encoder import A, B, QuadratureDecoder
from wheelwire.pi.gpio.base import encoder_pins
from wheelwire.pi.pins import Pins

BOARD = Pins(left_pwm=18, left_dir1=23, right_pwm=19, right_dir2=6)
LEFT_FORWARD, RIGHT_BACKWARD = (18, 23), (19, 6)
TRAVEL = 50
"""Ticks, of 360 a turn."""


def drive(robot: BareRobot, *high: int) -> npt.NDArray[np.void]:
    """With these GPIOs high until a wheel has gone some way; all edges."""
    robot.set_pins(lambda gpio: float(gpio in high), 0)
    found, start = [robot.advance()], robot.ticks

    def has_moved() -> bool:
        found.append(robot.advance())
        return max(abs(b - a) for a, b in zip(start, robot.ticks, strict=True)) > TRAVEL

    wait_until(has_moved)
    return np.concatenate(found)


def counted(edges: npt.NDArray[np.void], gpios: tuple[int, int]) -> tuple[int, int]:
    """What a decoder at these GPIOs counts: ticks, illegal changes."""
    decoder = QuadratureDecoder(0, 0)
    for t_ns, gpio, level in edges.tolist():
        if gpio in gpios:
            decoder.change(A if gpio == gpios[0] else B, level, t_ns)
    return decoder.ticks, decoder.illegal


def test_a_decoder_counts_each_wheels_edges_in_the_direction_of_its_stage() -> None:
    robot = BareRobot(BOARD)
    edges = drive(robot, *LEFT_FORWARD, *RIGHT_BACKWARD)
    assert robot.driven
    left, right = robot.ticks
    assert left > 0 > right
    assert counted(edges, encoder_pins(BOARD.left)) == (left, 0)
    assert counted(edges, encoder_pins(BOARD.right)) == (right, 0)
    assert np.all(np.diff(edges["t_ns"].astype(np.int64)) >= 0)


def test_both_wheels_spin_at_a_rate_whatever_the_motors_do() -> None:
    robot = BareRobot(BOARD)
    robot.advance()
    robot.spin(100_000)
    time.sleep(0.02)
    edges = robot.advance()
    left, right = robot.ticks
    assert left == right > 1000
    assert counted(edges, encoder_pins(BOARD.left)) == (left, 0)
    apart_ns = np.diff(edges["t_ns"][edges["gpio"] == BOARD.left.encoder_a].astype(np.int64))
    assert np.all(abs(apart_ns - 20_000) < 5000)


def test_a_dead_encoder_shows_no_edge_of_a_wheel_that_turns() -> None:
    robot = BareRobot(BOARD)
    robot.obey("dead_left_encoder")
    assert not drive(robot, *LEFT_FORWARD).size
    assert robot.ticks[0] > TRAVEL


def test_without_an_enable_nothing_turns() -> None:
    robot = BareRobot(BOARD)
    robot.set_pins(lambda gpio: float(gpio == LEFT_FORWARD[1]), 0)
    assert not robot.driven
    assert not robot.advance().size
