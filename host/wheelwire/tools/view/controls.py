"""Carries out the keys in threads of its own: the screen never waits for the robot."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from ...drivers.attached import AttachedDriver
from ...drivers.replay import ReplayDriver
from ...errors import InvalidCommand, WheelwireError
from ...robot.robot import Robot
from ..teleop.drive import STALE_S, Teleop, clear
from ..teleop.keys import Action, KeyEvent
from .tuning import Tuning

if TYPE_CHECKING:
    from ...log.recorder import Recorder

STOP, ESTOP, OTHER, TUNING = "stop", "e-stop", "other", "tuning"
"""Requests that do not wait for each other; of each kind one at a time is under way."""
END_S = 8.0
"""How long to wait for the end of a request; a call of the link takes 5 s at most."""


class Hand:
    """Drives by keys, in a thread of its own, with the meaning that they have in `teleop`.

    Args:
        robot: To be driven; stands when the thread has ended.
        say: Takes an event; from any thread.
    """

    def __init__(self, robot: Robot, say: Callable[[str], None]) -> None:
        self.teleop = Teleop(robot, say)
        self._robot = robot
        self._say = say
        self._keys: SimpleQueue[tuple[str, float] | None] = SimpleQueue()
        """The keys, each with the time of its press; None ends the thread."""
        self._thread = threading.Thread(target=self._run, name="wheelwire hand", daemon=True)
        self._thread.start()

    def press(self, key: str, *, stale: bool = False) -> None:
        """A key was pressed, or repeats; `stale`: it waited, and must not start a motion."""
        self._keys.put((key, -math.inf if stale else time.monotonic()))

    def let_go(self) -> None:
        """Stop the wheels, and end; without waiting."""
        self._keys.put(None)

    def end(self) -> None:
        """As `let_go`; waits until the robot has answered, or cannot."""
        self.let_go()
        self._thread.join(END_S)

    def _run(self) -> None:
        try:
            self.teleop.arm()
            while self._take_keys():
                self.teleop.command(time.monotonic())
        finally:  # however it ends, the wheels stop
            try:
                self._robot.stop()
                self._say("the keys no longer drive")
            except WheelwireError as error:
                self._say(f"the stop was not acknowledged ({error}); the robot stops by itself")

    def _take_keys(self) -> bool:
        """Carry out what was pressed, or wait a moment for it; False at the end."""
        keys, timeout_s = self._keys, self.teleop.wait_s(time.monotonic())
        with suppress(Empty):
            pressed = keys.get(timeout=max(0.0, timeout_s))
            while pressed is not None:
                key, pressed_s = pressed
                now = time.monotonic()
                stale = now - pressed_s > STALE_S
                self.teleop.take(KeyEvent(key, Action.TYPED), now, stale=stale)
                pressed = keys.get_nowait()  # all of them: the last one may be a stop
            return False
        return True


class Controls:
    """The robot, as a view's keys control it.

    Args:
        robot: Is closed by its owner.
        cannot_drive: Why this view cannot drive the robot; empty if it can.
        check_save: See `Tuning`.

    Attributes:
        said: The results of requests, which the screen takes.
        tuning: The parameters.
        hand: Drives; None while no key drives.
    """

    def __init__(
        self,
        robot: Robot,
        cannot_drive: str = "",
        check_save: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.said: SimpleQueue[str] = SimpleQueue()
        self.tuning = Tuning(robot.parameters, check_save)
        self.hand: Hand | None = None
        self._robot = robot
        self._cannot_drive = cannot_drive
        self._recorder: Recorder | None = None
        self._under_way: dict[str, threading.Thread] = {}
        self._closed = False

    @property
    def only_looks(self) -> str:
        """Why this view only looks and stops; empty if it may do all."""
        robot = self._robot
        if isinstance(robot, AttachedDriver):
            name = robot.holder.name
            return f"{name}, holds the port, and alone drives, sets, clears and records"
        if isinstance(robot, ReplayDriver):
            return "this is a recording"
        return ""

    # --- what is always done ---------------------------------------------------------------------

    def stop(self) -> None:
        """Stop the wheels."""
        self._halt(" ", STOP, self._stop)

    def estop(self) -> None:
        """Stop the wheels, and latch."""
        self._halt("e", ESTOP, self._estop)

    def _halt(self, key: str, kind: str, act: Callable[[], str]) -> None:
        if self.hand is not None:
            self.hand.press(key)  # lets go of the keys, too
        if not isinstance(self._robot, ReplayDriver) or self.may_act():
            self._ask(kind, act)

    def _stop(self) -> str:
        self._robot.stop()
        if isinstance(self._robot, AttachedDriver):
            return f"stopped; the next setpoint of {self._robot.holder.name}, drives again"
        return "stopped"

    def _estop(self) -> str:
        self._robot.estop()
        if isinstance(self._robot, AttachedDriver):
            return f"e-stop latched; {self._robot.holder.name}, may clear it"
        return "e-stop latched; c clears it"

    # --- only for the program that holds the robot -----------------------------------------------

    def clear(self) -> None:
        """Clear an e-stop or a fault."""
        if self.hand is not None:
            self.hand.press("c")  # it lets go of the keys, too
        elif self.may_act():
            self._ask(OTHER, self._clear)

    def _clear(self) -> str:
        ended = clear(self._robot)
        return "nothing is latched" if ended is None else f"{ended.name} cleared"

    def may_drive(self) -> bool:
        """Whether `drive` would work; if not, report why."""
        if self._cannot_drive and not self.only_looks:
            self.said.put(self._cannot_drive)
            return False
        return self.may_act()

    def drive(self) -> None:
        """Drive by keys from now on."""
        if self.hand is None and not self._closed:
            self.hand = Hand(self._robot, self.said.put)

    def let_go(self) -> None:
        """Stop the wheels, and drive no more."""
        hand, self.hand = self.hand, None
        if hand is not None:
            hand.let_go()

    def record(self) -> None:
        """Begin to record, or end it."""
        if self.may_act():
            self._ask(OTHER, self._record)

    def _record(self) -> str:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.close()
            return f"recorded: {recorder.file}"
        if not self._robot.has_device:
            raise InvalidCommand(
                "this robot's driver has no link that could be recorded: use another one"
            )
        self._recorder = self._robot.record(".")
        return f"recording to {self._recorder.file}"

    @property
    def recording(self) -> str:
        """The file that is recorded to; empty while none is."""
        recorder = self._recorder
        if recorder is not None and recorder.error is not None:
            self._recorder = None
            self.said.put(str(recorder.error))
            return ""
        return "" if recorder is None else recorder.file.name

    def tune(self, act: Callable[[], str]) -> None:
        """Carry out a method of `tuning`."""
        if act == self.tuning.read or self.may_act():
            self._ask(TUNING, act)

    def check_trial(self) -> None:
        """Leave a trial that was lost with the link."""
        tuning, under_way = self.tuning, self._under_way.get(TUNING)
        if (
            tuning.is_active
            and not self._robot.is_open
            and not (under_way is not None and under_way.is_alive())
        ):
            self._ask(TUNING, tuning.lose)

    # --- the end ---------------------------------------------------------------------------------

    def close(self) -> None:
        """Stop the wheels if they are driven from here, revert what is on trial, end the recording.

        Waits for the robot. Safe to call more than once.
        """
        self._closed = True
        hand, self.hand = self.hand, None
        if hand is not None:
            hand.end()
        for thread in tuple(self._under_way.values()):
            thread.join(END_S)
        self.tuning.abandon()
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.close()

    def may_act(self) -> bool:
        """Whether this view may do more than look and stop; if not, report why."""
        if self.only_looks:
            self.said.put(f"not from this view: {self.only_looks}")
        return not self.only_looks

    def _ask(self, kind: str, act: Callable[[], str]) -> None:
        before = self._under_way.get(kind)
        if self._closed and kind not in (STOP, ESTOP):
            return
        if before is not None and before.is_alive():
            if kind not in (STOP, ESTOP):  # which are repeated by themselves
                self.said.put("the robot has not answered yet: press the key again in a moment")
            return
        thread = threading.Thread(
            target=self._run, args=(act,), name=f"wheelwire view {kind}", daemon=True
        )
        self._under_way[kind] = thread
        thread.start()

    def _run(self, act: Callable[[], str]) -> None:
        try:
            text = act()
        except (WheelwireError, OSError) as error:
            text = str(error)
        if text:
            self.said.put(text)
