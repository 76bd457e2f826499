"""Every power stage on a computer's own pins: the board's struct decides what moves."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from support.gpio_chip_process import GpioChip
from support.pigpio_process import PigpioProcess
from support.processes import children
from support.stand_in import StandIn
from support.waiting import wait_until
from wheelwire.board import Configuration, WheelPins
from wheelwire.drivers.l298n import L298NDriver
from wheelwire.drivers.pigpio import PigpioDriver
from wheelwire.errors import LinkLost
from wheelwire.pi.gpio.base import encoder_pins, release_pins
from wheelwire.pi.gpio.pigpiod import PigpiodGpio
from wheelwire.robot.robot import Robot
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.board import EncoderPulls, Stage

PATIENT = {"overrun_limit_us": 1e6, "ttl_max_s": 5}
CORE_TIMEOUT_MS = 5000
TTL_S = 5.0
SPEED_MPS = 0.2
TRAVEL = 100
"""Ticks, of 360 a turn."""

PI = load_board("pi4b")
PWM, ENABLE, IN1, IN2, STANDBY = (18, 19), (12, 13), (23, 20), (24, 21), 25


def board(
    stage: Stage, pulldowns: tuple[int, ...] = (), **inputs: tuple[int, int]
) -> Configuration:
    left, right = (
        replace(
            WheelPins(encoder_a=wheel.encoder_a, encoder_b=wheel.encoder_b),
            **{name: pins[side] for name, pins in inputs.items()},
        )
        for side, wheel in enumerate((PI.left, PI.right))
    )
    return replace(
        PI, name=stage.name, stage=stage, left=left, right=right, pulldowns=frozenset(pulldowns)
    )


BOARDS = [
    board(Stage.ENABLE_IN1_IN2, ENABLE, enable=ENABLE, in1=IN1, in2=IN2),
    replace(board(Stage.PWM_IN1_IN2, pwm=PWM, in1=IN1, in2=IN2), standby=STANDBY),
    replace(board(Stage.IN_IN, in1=IN1, in2=IN2), standby=STANDBY),
    board(Stage.HALF_BRIDGES, ENABLE, enable=ENABLE, in1=IN1, in2=IN2),
    board(Stage.PWM_DIR, PWM, pwm=PWM, dir=IN1),
]


Rig = tuple[Robot, StandIn]
Open = Callable[[Configuration], AbstractContextManager[Rig]]


@pytest.fixture
def open_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Open:
    """Opens `l298n` on a board's pins, with that kind of board behind them."""

    @contextmanager
    def library(board: Configuration) -> Iterator[Rig]:
        with GpioChip(tmp_path, kernel_pwm=False, board=board) as chip:
            for name, value in chip.environment.items():
                monkeypatch.setenv(name, value)
            with L298NDriver(
                pins=board,
                pwm_directory=chip.pwm_directory,
                parameters=PATIENT,
                core_timeout_ms=CORE_TIMEOUT_MS,
            ) as robot:
                yield robot, chip

    return library


@contextmanager
def daemon(board: Configuration) -> Iterator[Rig]:
    """`pigpio`, likewise."""
    with (
        PigpioProcess("--board", board.packed().hex()) as process,
        PigpioDriver(
            "127.0.0.1",
            process.port,
            pins=board,
            parameters=PATIENT,
            core_timeout_ms=CORE_TIMEOUT_MS,
        ) as robot,
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
        robot.stop()
        wait_until(lambda: not is_driven(stand_in))
        left, right = robot.read().left_ticks, robot.read().right_ticks
        assert (left, right) == pytest.approx(travel(stand_in), abs=40)
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


@pytest.mark.whole
@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
def test_each_stage_is_released_when_its_core_is_killed(
    open_library: Open, board: Configuration
) -> None:
    with open_library(board) as (robot, chip):
        drive(robot, chip, SPEED_MPS)
        (guard,) = (pid for pid in children(os.getpid()) if children(pid))
        (core,) = children(guard)
        os.kill(core, signal.SIGKILL)
        # Standby may be high again: the driver restarts its process.
        inputs = set(release_pins(board)) - {board.standby}
        wait_until(lambda: not any(chip.truth()["lines"][gpio] for gpio in inputs))
        assert not is_driven(chip)


@pytest.mark.whole
def test_a_stage_on_standby_drives_again_after_the_daemon_has_let_go_of_it() -> None:
    with daemon(next(board for board in BOARDS if board.standby is not None)) as (robot, pigpiod):
        drive(robot, pigpiod, SPEED_MPS)
        (guard,) = (pid for pid in children(os.getpid()) if children(pid))
        (core,) = children(guard)
        os.kill(core, signal.SIGSTOP)
        wait_until(lambda: not is_driven(pigpiod))  # by the script inside the daemon
        os.kill(core, signal.SIGCONT)
        drive(robot, pigpiod, SPEED_MPS)
