"""What holds a robot and what ended its last motion: asked by its program, and by a new one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import pytest

from wheelwire.board import DigitalInput, Pull
from wheelwire.drivers.mock import MockDriver, VirtualMockDriver
from wheelwire.errors import DeviceRefused, WheelwireError
from wheelwire.link.holds import UNARMED, HeldBy
from wheelwire.log.why.device import stops_of_device
from wheelwire.robot.black_boxes import Recorded
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.codes import (
    Contradiction,
    EstopSource,
    Held,
    PeripheralKind,
    Place,
    ResetReason,
    StopCause,
    StopMode,
)
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import Estop, Stop

REPORTED_S = 0.2
"""A change is reported within this time."""
AT_REST_S = 2.0


def drive(robot: VirtualMockDriver, seconds: float = 0.6, speed: float = 0.2) -> None:
    """As a program that goes on whatever it is answered."""
    for _ in range(round(seconds / 0.05)):
        with suppress(WheelwireError):
            robot.set_velocity(speed, 0.0, ttl=0.2)
        robot.advance(0.05)


def stranger(robot: VirtualMockDriver, message: Estop | Stop) -> None:
    """Another program writes to the port."""
    robot.simulator.write(b"\0" + encode_frame(message, 0))
    robot.advance(0.05)


def sets(name: str, value: float = 1.0) -> Callable[[VirtualMockDriver], None]:
    """Something of the robot changes while its program drives on."""

    def play(robot: VirtualMockDriver) -> None:
        robot.simulator.set(name, value)
        drive(robot, 3.0)

    return play


def waits(robot: VirtualMockDriver) -> None:
    robot.advance(1.0)


def clears(robot: VirtualMockDriver) -> None:
    robot.estop()
    robot.clear_estop()
    drive(robot, 0.3)


def bumps(name: str) -> Callable[[VirtualMockDriver], None]:
    def play(robot: VirtualMockDriver) -> None:
        robot.simulator.set(f"bumper.{name}", 1)
        drive(robot, 0.3)

    return play


def bumps_and_goes_on(robot: VirtualMockDriver) -> None:
    bumps("front_left")(robot)
    robot.simulator.set("bumper.front_left", 0)
    drive(robot, 0.3)


def resets(reason: ResetReason) -> Callable[[VirtualMockDriver], None]:
    def play(robot: VirtualMockDriver) -> None:
        robot.simulator.reset(reason)
        robot.advance(2.0)

    return play


def tries(robot: VirtualMockDriver) -> None:
    with robot.parameters.trial():
        robot.parameters.set("max_velocity_mps", 0.4)
        drive(robot, 0.3)


def contradicts(robot: VirtualMockDriver) -> None:
    with robot.parameters.trial():
        robot.stop()
        robot.advance(AT_REST_S)
        robot.parameters.set("control_rate_hz", 100.0)
        robot.parameters.set("stream_rate_hz", 200.0)
        robot.advance(REPORTED_S)
        assert Held.CONTRADICTION in held_by(robot)
        assert held_by(robot).contradictions == Contradiction.STREAM_RATE


class Staged(NamedTuple):
    """A hold and a stop, and the only right answer.

    Attributes:
        play: Brings it about, from a robot that drives.
        cause: What ended the last motion.
        held: What holds it then, seen by the program that drives.
        source: Who latched the e-stop.
        after: What still holds it for a new program; None: the same.
        why: What `why` then names, among others.
        board: What is wired to its board; empty: what the simulated robot has.
    """

    play: Callable[[VirtualMockDriver], object]
    cause: StopCause
    why: str
    held: Held = Held(0)
    source: EstopSource = EstopSource.NONE
    after: Held | None = None
    board: tuple[DigitalInput, ...] = ()


CLIFF = DigitalInput(PeripheralKind.CLIFF, Place.FRONT, 36, pull=Pull.EXTERNAL)
ESTOP = Held.ESTOP
STAGED = {
    "deadline": Staged(waits, StopCause.DEADLINE, "program_paused"),
    "stop of another": Staged(
        lambda robot: stranger(robot, Stop(9, 1, 0, StopMode.COAST)),
        StopCause.STOP_OTHER,
        "stop_by_stranger",
    ),
    "e-stop of another": Staged(
        lambda robot: stranger(robot, Estop(9, 1)),
        StopCause.ESTOP_OTHER,
        "estop_by_stranger",
        ESTOP,
        EstopSource.OTHER_PROGRAM,
    ),
    "contact open": Staged(
        sets("estop_open"),
        StopCause.ESTOP_CONTACT,
        "contact_open",
        ESTOP | Held.CONTACT,
        EstopSource.CONTACT,
    ),
    "wheel blocked": Staged(sets("left.blocked"), StopCause.FAULT, "encoder_dead", Held.FAULT),
    "bumper left": Staged(
        bumps("front_left"),
        StopCause.BUMPER,
        "held_bumper_front_left",
        Held.BUMPER_FRONT_LEFT | Held.UNARMED_FORWARD,
        after=Held.BUMPER_FRONT_LEFT,
    ),
    "bumper, and goes on": Staged(
        bumps_and_goes_on,
        StopCause.BUMPER,
        "bumper_pressed",
        Held.UNARMED_FORWARD,
        after=Held(0),
    ),
    "cliff": Staged(
        sets("cliff.front"),
        StopCause.CLIFF,
        "cliff_seen",
        Held.CLIFF | Held.FAULT,
        board=(CLIFF,),
    ),
    "clear": Staged(
        clears, StopCause.ESTOP_SESSION, "estop_by_session", Held.UNARMED, after=Held(0)
    ),
    "trial left": Staged(tries, StopCause.TRIAL_ENDED, "trial_expired"),
    "contradiction": Staged(contradicts, StopCause.STOP, "stop_by_session"),
    "panic": Staged(resets(ResetReason.PANIC), StopCause.RESET, "panic"),
    "new session": Staged(
        lambda robot: renew(robot), StopCause.NEW_SESSION, "new_session", after=Held(0)
    ),
}


def held_by(robot: VirtualMockDriver) -> HeldBy:
    found = robot.health.held_by
    assert found is not None
    return found


def renew(robot: VirtualMockDriver) -> None:
    """A new program opens a session."""
    robot.unplug()
    robot.plug()
    sessions = robot.sessions
    for _ in range(100):
        robot.advance(0.05)
        if robot.sessions > sessions and robot.is_open:
            return
    raise AssertionError("no new session")


@pytest.mark.parametrize("name", STAGED)
def test_the_program_that_drives_and_a_new_one_know(name: str) -> None:
    staged = STAGED[name]
    with MockDriver(realtime=False) as robot:
        assert isinstance(robot, VirtualMockDriver)
        reported: list[HeldBy] = []
        robot.on_held = reported.append
        if staged.board:
            robot.board.take_up(replace(load_board("l298n"), peripherals=staged.board))
            robot.set_velocity(0.0, 0.0)  # the board has taken a restart
        drive(robot)
        assert not held_by(robot)
        staged.play(robot)
        robot.advance(REPORTED_S)
        assert held_by(robot).flags == staged.held, held_by(robot)
        assert held_by(robot).estop_source is staged.source
        assert not staged.held or reported[-1] == held_by(robot)
        stop = robot.last_stop
        assert stop is not None
        assert stop.cause is staged.cause, stop
        assert str(stop)
        renew(robot)
        robot.advance(AT_REST_S)
        holding = robot.holding()
        after = staged.held if staged.after is None else staged.after
        assert (holding.held_by.flags, holding.last_stop.cause) == (after, staged.cause)
        found = stops_of_device(robot.info.device, robot.read(), Recorded(), holding)
        causes = " or ".join(one.stop.cause for one in found)
        assert staged.why in causes
        assert bool(causes) == bool(staged.why)
        if staged.cause not in (StopCause.UNKNOWN, StopCause.RESET):
            # A wheel that is held fast slows the other one down.
            least_mps = 0.0 if staged.cause is StopCause.FAULT else 0.05
            assert least_mps <= holding.last_stop.speed_mps < 0.3
            assert holding.last_stop.is_at_rest
            assert holding.last_stop.rolled_m < 0.2


def is_unarmed(robot: VirtualMockDriver) -> bool:
    assert robot.is_unarmed == bool(held_by(robot).flags & UNARMED)
    return robot.is_unarmed


def refused(robot: VirtualMockDriver) -> None:
    """Ask for motion until the refusal has come."""
    with pytest.raises(DeviceRefused):  # noqa: PT012 - it comes with the next setpoint
        for _ in range(3):
            robot.set_velocity(0.2, 0.0)
            robot.advance(0.01)


@pytest.mark.parametrize("ends", ["zero", "pause"])
@pytest.mark.parametrize(
    "play",
    [clears, bumps_and_goes_on, lambda robot: robot.simulator.reset(ResetReason.PANIC)],
    ids=["clear", "bumper", "reset"],
)
def test_it_is_unarmed_from_the_refusal_until_a_zero_or_a_pause(
    play: Callable[[VirtualMockDriver], None], ends: str
) -> None:
    with MockDriver(realtime=False) as robot:
        assert isinstance(robot, VirtualMockDriver)
        drive(robot)
        play(robot)
        drive(robot, 1.0)
        assert is_unarmed(robot)
        refused(robot)
        if ends == "zero":
            robot.set_velocity(0.0, 0.0)
            robot.advance(REPORTED_S)
        else:
            robot.advance(1.0 + REPORTED_S)
        assert not is_unarmed(robot)
        robot.set_velocity(0.2, 0.0)


def test_a_stop_tells_when_it_was_and_how_far_the_robot_rolled() -> None:
    with MockDriver(realtime=False) as robot:
        assert isinstance(robot, VirtualMockDriver)
        drive(robot)
        waits(robot)
        robot.advance(AT_REST_S)
        stop = robot.last_stop
        sample = robot.read()
    assert stop is not None
    assert stop.t_us is not None
    assert stop.stamp == pytest.approx(sample.stamp - (sample.t_us - stop.t_us) / 1e6, abs=1e-3)
    assert stop.command_seq == sample.command_seq
    assert "The setpoint of the program that drove expired" in str(stop)
    assert "came to rest" in str(stop)


def test_the_cause_of_a_hold_is_unknown_out_of_reach() -> None:
    with MockDriver(realtime=False) as robot:
        assert isinstance(robot, VirtualMockDriver)
        robot.advance(0.1)
        assert robot.held_by is not None
        robot.unplug()
        robot.advance(0.1)
        assert robot.held_by is None
        assert robot.last_stop is None
