"""A hand at the keys of a robot in virtual time, and how far it drives after it let go."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from wheelwire.drivers.mock import MockDriver
from wheelwire.tools.teleop.drive import Teleop
from wheelwire.tools.teleop.keys import SPACE, Action, KeyEvent
from wheelwire_protocol.codes import SupervisorState

STEP_S = 0.001
KEYBOARD_DELAY_S = 0.5
REPEAT_S = 0.033
HELD_S = 2.0
TIMEOUT_S = 5.0
KEY = "w"


class Hand:
    """A hand at the keys. The loop of `wheelwire teleop` runs in `wait`."""

    def __init__(self, robot: MockDriver, step_s: float = STEP_S) -> None:
        self.robot = robot
        self.said: list[str] = []
        self.teleop = Teleop(robot, self.said.append)
        self._step_s = step_s

    @property
    def now(self) -> float:
        """The robot's virtual clock. [s]"""
        return self.robot._now_us() / 1e6

    def key(self, key: str, action: Action = Action.TYPED, *, stale: bool = False) -> None:
        """One event of a key."""
        self.teleop.take(KeyEvent(key, action), self.now, stale=stale)
        self.teleop.command(self.now)

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds
        due = self.now
        while self.now < end:
            if self.now >= due:
                self.teleop.command(self.now)
                due = self.now + self.teleop.wait_s(self.now)
            self.robot.advance(self._step_s)

    def state(self) -> SupervisorState:
        """The supervisor's state."""
        self.robot.read()  # the one before
        return self.robot.read().state

    def true(self, name: str) -> float:
        """A variable of the simulation."""
        return self.robot.simulator.get(name)


class Stop(NamedTuple):
    """From the hand's last action to standstill."""

    seconds: float
    metres: float


def _hold(
    hand: Hand,
    first: Action = Action.TYPED,
    repeat: Action = Action.TYPED,
    last: tuple[str, Action] | None = None,
) -> None:
    """Until just after a repeat, which is the latest moment, or to a last key."""
    hand.key(KEY, first)
    hand.wait(KEYBOARD_DELAY_S)
    end = hand.now + HELD_S
    while hand.now < end:
        hand.key(KEY, repeat)
        hand.wait(REPEAT_S)
    hand.key(KEY, repeat)
    if last is not None:
        hand.key(*last)


LETTING_GO: dict[str, Callable[[Hand], None]] = {
    "one press": lambda hand: hand.key(KEY),
    "a held key, no releases reported": _hold,
    "a held key, releases reported": lambda hand: _hold(
        hand, Action.PRESSED, Action.REPEATED, (KEY, Action.RELEASED)
    ),
    "space": lambda hand: _hold(hand, last=(SPACE, Action.TYPED)),
}


def stop_after(action: Callable[[Hand], None], speed: int) -> Stop:
    """The way from the end of `action` to standstill."""
    with MockDriver(realtime=False) as robot:
        hand = Hand(robot)
        hand.teleop.speed = speed
        action(hand)
        start, start_m = hand.now, hand.true("true.distance_m")
        end = start + TIMEOUT_S
        hand.wait(0.01)  # a tap has to begin to move first
        while hand.true("drive_on") or not hand.true("stands_still"):
            assert hand.now < end, "it never stopped"
            hand.wait(STEP_S)
        return Stop(hand.now - start, hand.true("true.distance_m") - start_m)
