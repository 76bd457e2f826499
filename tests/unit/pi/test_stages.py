"""Every power stage on a computer's own pins: the board's struct decides what moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from support.gpio_chip_process import GpioChip
from support.pigpio_process import PigpioProcess
from support.pin_drivers import l298n_on, pigpio_on
from support.stage_boards import PI, STANDBY, board_of
from support.stand_in import StandIn
from support.waiting import stop_and_stand, wait_until
from wheelwire.board import Configuration
from wheelwire.errors import LinkLost
from wheelwire.pi.gpio.base import encoder_pins
from wheelwire.pi.gpio.pigpiod import PigpiodGpio
from wheelwire.robot.robot import Robot
from wheelwire_protocol.board import EncoderPulls
from wheelwire_protocol.power_stages import Stage

TTL_S = 5.0
SPEED_MPS = 0.2
TRAVEL = 100
"""Ticks, of 360 a turn."""

ON_STANDBY = (Stage.PWM_IN1_IN2, Stage.IN_IN)
BOARDS = [board_of(stage, STANDBY if stage in ON_STANDBY else None) for stage in Stage]

Rig = tuple[Robot, StandIn]
Open = Callable[[Configuration], AbstractContextManager[Rig]]


@pytest.fixture
def open_library(tmp_path: Path) -> Open:
    """Opens `l298n` on a board's pins, with that kind of board behind them."""

    @contextmanager
    def library(board: Configuration) -> Iterator[Rig]:
        with (
            GpioChip(tmp_path, kernel_pwm=False, board=board) as chip,
            l298n_on(chip, pins=board) as robot,
        ):
            yield robot, chip

    return library


@contextmanager
def daemon(board: Configuration) -> Iterator[Rig]:
    """`pigpio`, likewise."""
    with (
        PigpioProcess("--board", board.packed().hex()) as process,
        pigpio_on(process, pins=board) as robot,
    ):
        yield robot, process


@pytest.fixture(params=["l298n", "pigpio"])
def open_rig(request: pytest.FixtureRequest, open_library: Open) -> Open:
    return open_library if request.param == "l298n" else daemon


def travel(stand_in: StandIn) -> tuple[int, int]:
    left, right = stand_in.truth()["ticks"]
    return left, right


def is_driven(stand_in: StandIn) -> bool:
    return bool(stand_in.truth()["driven"])


def drive(robot: Robot, stand_in: StandIn, speed_mps: float) -> None:
    """Until both wheels have gone some way."""
    sign = 1 if speed_mps > 0 else -1
    start = travel(stand_in)

    def has_moved() -> bool:
        # A core that this computer gave no time takes no setpoints for a while.
        with suppress(LinkLost):
            robot.set_velocity(speed_mps, 0.0, ttl=TTL_S)
        ways = [sign * (b - a) for a, b in zip(start, travel(stand_in), strict=True)]
        return min(ways) > TRAVEL

    wait_until(has_moved)


@pytest.mark.whole
@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
def test_each_stage_drives_reverses_and_stops(open_rig: Open, board: Configuration) -> None:
    assert board.problems() == []
    with open_rig(board) as (robot, stand_in):
        drive(robot, stand_in, SPEED_MPS)
        drive(robot, stand_in, -SPEED_MPS)
        assert not robot.read().faults
        stop_and_stand(robot)
        wait_until(lambda: not is_driven(stand_in))
        sample = robot.read()
        assert (sample.left_ticks, sample.right_ticks) == pytest.approx(travel(stand_in), abs=40)
        robot.close()
        assert not is_driven(stand_in)


@pytest.mark.whole
@pytest.mark.parametrize(
    ("pulls", "encoders"), [(EncoderPulls.INTERNAL, "up"), (EncoderPulls.EXTERNAL, "floating")]
)
def test_the_board_says_who_pulls_the_encoders_up(
    open_rig: Open, pulls: EncoderPulls, encoders: str
) -> None:
    board = replace(PI, encoder_pulls=pulls, estop=25)
    with open_rig(board) as (_, stand_in):
        shown = stand_in.truth()["pulls"]
        pins = [pin for wheel in (board.left, board.right) for pin in encoder_pins(wheel)]
        assert [shown[pin] for pin in pins] == [encoders] * 4
        assert shown[25] == "up"  # a contact to ground has nothing else


@pytest.mark.whole
def test_a_pin_with_a_resistor_on_the_computer_s_board_takes_no_other_pull(
    open_library: Open,
) -> None:
    left = replace(PI.left, encoder_a=2, encoder_b=3)
    board = replace(PI, encoder_pulls=EncoderPulls.EXTERNAL, left=left)
    with open_library(board) as (_, chip):
        assert [chip.truth()["pulls"][pin] for pin in (2, 3)] == ["up", "up"]


@pytest.mark.parametrize(("samples", "is_open"), [([1, 1], True), ([1, 0], False), ([0], False)])
def test_the_contact_is_open_when_two_samples_say_so(samples: list[int], is_open: bool) -> None:
    levels = iter(samples)
    gpio = PigpiodGpio.__new__(PigpiodGpio)
    gpio.board = replace(PI, estop=25)
    gpio._client = cast("Any", SimpleNamespace(call=lambda *_: next(levels)))
    assert gpio.contact_is_open() is is_open
