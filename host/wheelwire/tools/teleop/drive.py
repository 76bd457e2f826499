"""Driving a robot by the keys of a terminal."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from wheelwire_protocol.codes import RefusalCode, SupervisorState

from ...errors import DeviceRefused, RequestTimeout, WheelwireError
from ...motion.kinematics import Twist
from ...robot.robot import Robot
from . import keys
from .keys import KeyEvent
from .terminal import Terminal

SPEEDS = 10
"""Steps of the speed; the last one is the robot's limit."""
DEFAULT_SPEED = 4
PERIOD_S = 0.05
TTL_S = 0.3
"""Longest time to live of a setpoint: a program that hangs or is killed drives no longer."""
STALE_S = 0.25
"""Keys that waited about this long, because the program did not run, drive no more."""
SHOW_PERIOD_S = 0.1
HELP = """\
  w a s d or arrows  drive          + - or 1..9, 0  speed
  space              stop           q or Ctrl-C     quit: stops, too
  e                  e-stop         c               clear an e-stop or a fault"""

RELEASE_FIRST = "the robot is held: unarmed; release the keys, then drive"

_FASTER, _SLOWER = ("+", "="), ("-", "_")


class Teleop:
    """The meaning of the keys. Times are `time.monotonic()`, or a robot's virtual clock.

    Args:
        robot: Is stopped by its owner at the end.
        say: Shows an error or an event.
        speed: 1 to `SPEEDS`.
    """

    def __init__(
        self, robot: Robot, say: Callable[[str], None], speed: int = DEFAULT_SPEED
    ) -> None:
        self._robot = robot
        self._say = say
        self._presses = keys.Presses()
        self._complaint = ""
        self._waits_for_release = False
        """Whether all keys have to be released first, as after a clear."""
        self._sent: tuple[int, int, int] | None = None
        """The newest setpoint that the robot may still obey: directions and speed."""
        self._sent_until = 0.0
        """When it ends."""
        self.speed = speed
        self.done = False
        """The user wants to quit."""

    @property
    def velocity(self) -> Twist:
        """Velocities at the speed that is set: straight ahead, and turning on the spot.

        Turning, each wheel has half the speed that it has straight ahead: a whole one is hard to
        steer.
        """
        geometry = self._robot.geometry
        linear_mps = geometry.max_velocity_mps * self.speed / SPEEDS
        return Twist(linear_mps, linear_mps / geometry.wheel_separation)

    def arm(self) -> None:
        """Have the robot obey the first key, where it was opened only to look at it.

        This does what opening a robot to drive does: it leaves it stopped. A refusal is not an
        error here, because the first key is refused for the same reason.
        """
        with suppress(WheelwireError):
            self._robot.set_velocity(0.0, 0.0, self._longest_s)
            self._robot.stop()

    def take(self, event: KeyEvent, now: float, *, stale: bool = False) -> None:
        """Carry out a key. `stale`: it waited, and must not start a motion.

        Raises:
            KeyboardInterrupt: It was Ctrl-C as a key.
        """
        key, action = event
        try:
            if key in keys.DIRECTIONS:
                self._take_direction(event, now, stale=stale)
            elif action is not keys.Action.RELEASED:
                self._take_command(key)
        except WheelwireError as error:
            self._complain(error)

    def command(self, now: float) -> None:
        """Send the setpoint that the keys ask for; it lives no longer than they do."""
        motion = self._presses.motion(now)
        life_s = motion.until - now
        longest_s = self._longest_s
        setpoint = motion.forward, motion.left, self.speed
        # The last setpoint lasts to the end of the press, so that none has to arrive within the
        # little that is left.
        if self._sent == setpoint and self._sent_until >= motion.until:
            return
        if motion is keys.STILL or life_s < PERIOD_S:
            return
        try:
            linear, angular = self.velocity
            asked = motion.forward * linear, motion.left * angular
            self._robot.set_velocity(*asked, min(longest_s, life_s), stamp=now)
        except WheelwireError as error:
            self._complain(error)
        else:
            self._complaint = ""
            self._sent = setpoint
            self._sent_until = motion.until if life_s <= longest_s else now + longest_s

    @property
    def _longest_s(self) -> float:
        """For how long a setpoint may live."""
        return min(TTL_S, self._robot.ttl_max_s or TTL_S)

    def wait_s(self, now: float) -> float:
        """How long nothing is to be done without a key."""
        return min(PERIOD_S, self._presses.motion(now).until - now)

    def _complain(self, error: WheelwireError) -> None:
        """Let go of all keys; say why once, not at each repeat of a key that is held."""
        self._let_go()
        text = str(error)
        if isinstance(error, DeviceRefused) and error.code == RefusalCode.UNARMED:
            self._waits_for_release = True
            text = RELEASE_FIRST
        # A refusal's sentence grows once the device has said what holds it.
        complaint = str(int(error.code)) if isinstance(error, DeviceRefused) else text
        if complaint != self._complaint:
            self._complaint = complaint
            self._say(text)

    def _take_direction(self, event: KeyEvent, now: float, *, stale: bool) -> None:
        released = event.action is keys.Action.RELEASED
        # A release only ever ends a motion, so it counts however late it comes.
        if stale and not released:
            return
        drove = self._presses.motion(now) is not keys.STILL
        self._presses.take(event, now)
        # Only the last release stops at once: until then another key asks for some motion.
        if released and drove and self._presses.motion(now) is keys.STILL:
            # The stop voids what was sent, whether or not its answer comes.
            self._sent = None
            self._robot.stop()
        if released and self._waits_for_release:
            # Where releases are not reported, a pause does.
            self._waits_for_release = False
            self._robot.set_velocity(0.0, 0.0, self._longest_s)

    def _let_go(self) -> None:
        self._presses.clear()
        self._sent = None

    def _take_command(self, key: str) -> None:
        # A person who presses a command wants to know what is wrong, even if it was shown before.
        self._complaint = ""
        if key == keys.INTERRUPT:
            raise KeyboardInterrupt
        if key == keys.SPACE:
            self._let_go()
            self._robot.stop()
        elif key == "e":
            self._let_go()
            self._robot.estop()
            self._say("e-stop latched; c clears it")
        elif key == "c":
            self._let_go()
            self._clear()
        elif key == "q":
            self.done = True
        elif key in _FASTER:
            self.speed = min(self.speed + 1, SPEEDS)
        elif key in _SLOWER:
            self.speed = max(self.speed - 1, 1)
        elif key in "0123456789":
            self.speed = int(key) or SPEEDS

    def _clear(self) -> None:
        ended = clear(self._robot)
        if ended is None:
            self._say("nothing is latched")
            return
        # A clear alone restarts nothing. All keys were let go above: a motion needs a new press.
        self._robot.set_velocity(0.0, 0.0, self._longest_s)
        self._say(f"{ended.name} cleared")


def clear(robot: Robot) -> SupervisorState | None:
    """End what is latched; returns what it was, or None if nothing is.

    Raises:
        WheelwireError: As `clear_estop` and `clear_fault`.
    """
    robot.read()  # it may be older than the last e-stop
    state = robot.read().state
    if state is SupervisorState.ESTOPPED:
        robot.clear_estop()
    elif state is SupervisorState.FAULT:
        robot.clear_fault()
    else:
        return None
    return state


def drive(robot: Robot, terminal: Terminal, speed: int = DEFAULT_SPEED) -> None:
    """Drive by keys until q, or until the terminal is gone. The robot's owner stops it then.

    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    teleop = Teleop(robot, terminal.say, speed)
    decoder = keys.KeyDecoder()
    seen, show_from = time.monotonic(), 0.0
    while not teleop.done:
        data = terminal.read(teleop.wait_s(time.monotonic()))
        if data is None:
            return
        now = time.monotonic()
        # What was typed may have waited for as long as this loop did not come round.
        stale, seen = now - seen > STALE_S, now
        for event in decoder.feed(data):
            if isinstance(event, keys.KeyboardFlags):
                terminal.take_flags(event)
            else:
                # Read the time again: a key before this one may have waited for the robot's answer.
                teleop.take(event, time.monotonic(), stale=stale)
        teleop.command(time.monotonic())
        if now >= show_from:
            show_from = now + SHOW_PERIOD_S
            if text := _text(robot, teleop):
                terminal.show(text)


def _text(robot: Robot, teleop: Teleop) -> str | None:
    """The line with the robot's state and speed; None without a new sample."""
    try:
        sample = robot.read(0)
    except RequestTimeout:
        return None
    except WheelwireError as error:
        return str(error)
    velocity = teleop.velocity
    return (
        f"{sample.state.name:9}  left {sample.left_mps:+.2f}  right {sample.right_mps:+.2f} m/s"
        f"  speed {teleop.speed}: {velocity.linear_mps:.2f} m/s, "
        f"{velocity.angular_radps:.1f} rad/s"
    )
