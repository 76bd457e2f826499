"""The application on the whole screen of a terminal."""

from __future__ import annotations

import asyncio
import math
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from queue import Empty
from typing import ClassVar

from textual.app import App
from textual.binding import Binding, BindingType
from textual.screen import Screen

from ...errors import LinkClosed, RecordingError, WheelwireError
from ...log.reader import offset_us
from ...robot.robot import Robot
from ..teleop.drive import STALE_S, Teleop
from ..teleop.keys import DIRECTIONS
from . import screens
from .controls import Controls
from .model import Model
from .screens import ParametersScreen, RobotScreen, TextScreen
from .source import Source

LOOK_S = 0.05
RESUMED_S = 0.5
"""No key drives for this long after a suspension: longer than old keys wait in Textual's queues."""
LOOKS_PER_PICTURE = 5
"""Four pictures a second: more would cost processor time without showing more."""
_HAND_KEYS = (*DIRECTIONS, *"0123456789+-=_")
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class ViewApp(App[None]):
    """Shows one robot, and hands the keys to `Controls`.

    Args:
        model: What is shown.
        source: Fills it.
        controls: Does what the keys ask for.
        seconds: For how long; 0: until a key or a signal ends it.
        stays: Whether the view goes on when the robot is gone for good, as at a recording's end.

    Attributes:
        ended_by: The signal that ended it; None for a key or the time.
        failure: Why it ended, if that was an error.
    """

    CSS = """
    Screen { layout: vertical; overflow: hidden; }
    #title, #axis, #state1 { height: 1; }
    #table, #events { height: 1fr; }
    #link, #keys { height: auto; }
    #keys { text-style: reverse; }
    #events2, #explain { height: 2; }
    #table { scrollbar-size-horizontal: 0; }
    #table > .datatable--cursor { background: ansi_default; color: ansi_default; }
    #table > .datatable--cursor { text-style: reverse; }
    #table > .datatable--header { text-style: bold underline; }
    TextScreen { align: center middle; }
    #text { width: auto; max-width: 100%; height: auto; max-height: 100%; }
    #text { padding: 0 1; border: solid; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "stop", priority=True),
        Binding("e,E", "estop", priority=True),
        Binding("ctrl+c", "interrupt", priority=True),
        Binding("ctrl+q", "end", priority=True),
    ]
    ENABLE_COMMAND_PALETTE = False

    def __init__(
        self,
        model: Model,
        source: Source,
        controls: Controls,
        *,
        seconds: float = 0.0,
        stays: bool = False,
    ) -> None:
        super().__init__(ansi_color=True)
        self.model = model
        self.controls = controls
        self.ended_by: signal.Signals | None = None
        self.failure: WheelwireError | None = None
        self._source = source
        self._end_s = time.monotonic() + seconds if seconds else None
        self._stays = stays
        self._looks = 0
        self._looked_s = self._fresh_from_s = -math.inf
        self._over = False
        """Whether the robot is gone for good."""
        self._ending = False

    def get_default_screen(self) -> Screen[None]:
        """As Textual wants it."""
        return RobotScreen()

    def on_mount(self) -> None:
        """Begin to look, and to hear signals."""
        loop = asyncio.get_running_loop()
        for number in _SIGNALS:
            if signal.getsignal(number) != signal.SIG_IGN:  # `nohup`, for example, ignores it
                loop.add_signal_handler(number, self._end, number)
        # Textual's own handler would start a second keyboard thread, while the one before the
        # SIGSTOP still runs. Each would take some of the keys, and the view would not end.
        loop.add_signal_handler(signal.SIGCONT, self._restore_terminal)
        self.set_interval(LOOK_S, self._look)
        self._look()

    # --- what is shown ---------------------------------------------------------------------------

    def modes(self) -> Iterator[str]:
        """What the view does besides showing the robot."""
        controls = self.controls
        if self._ending:
            yield "ending"
        if controls.hand is not None:
            yield f"keys drive, {_speed(controls.hand.teleop)}"
        if controls.tuning.is_active:
            yield f"{len(controls.tuning.changed)} on trial"
        if recording := controls.recording:
            yield f"recording {recording}"
        if controls.only_looks:
            yield "a recording" if self._stays else "only looks and stops"

    def keys(self) -> tuple[tuple[str, str], ...]:
        """The keys that do something now."""
        if self.controls.hand is not None:
            return screens.DRIVING_KEYS
        if self._stays:
            return screens.RECORDING_KEYS
        return screens.LOOKING_KEYS if self.controls.only_looks else screens.KEYS

    def _look(self) -> None:
        now = time.monotonic()
        if now - self._looked_s > STALE_S:  # for the keys that come behind this look
            self._fresh_from_s = max(self._fresh_from_s, now + 2 * LOOK_S)
        self._looked_s = now
        if not self._over:
            try:
                self._source.look()
            except (LinkClosed, RecordingError) as error:
                self._lose(error)
        with suppress(Empty):
            while True:
                self.model.say(self.controls.said.get_nowait())
        self.controls.check_trial()
        self._looks += 1
        if self._looks % LOOKS_PER_PICTURE == 1 and isinstance(
            self.screen, (RobotScreen, ParametersScreen)
        ):
            self.screen.show()
        if self._end_s is not None and time.monotonic() >= self._end_s:
            self._end(None)

    def _lose(self, error: LinkClosed | RecordingError) -> None:
        self._over = True
        if self._stays:
            self.model.ended = str(error)
            self.model.say(str(error))
        else:
            self.failure = error
            self._end(None)

    # --- keys ------------------------------------------------------------------------------------

    def press(self, key: str, character: str) -> None:
        """A key on the robot's screen."""
        if not isinstance(self.screen, RobotScreen):
            return  # the key before it has opened another one
        hand = self.controls.hand
        name = key if key in DIRECTIONS else character.lower()
        if hand is not None and name in _HAND_KEYS:
            hand.press(name, stale=self._is_behind)
            return
        actions: dict[str, Callable[[], object]] = {
            "c": self.controls.clear,
            "p": lambda: self.push_screen(ParametersScreen()),
            "t": self._toggle_drive,
            "r": self.controls.record,
            "?": lambda: self.push_screen(TextScreen(screens.HELP)),
            "q": self.action_end,
        }
        if key == "escape":
            self.controls.let_go()
        elif name in actions:
            actions[name]()

    @property
    def _is_behind(self) -> bool:
        """Whether this program has not run for a while, so that its keys may be old ones."""
        now = time.monotonic()
        return now - self._looked_s > STALE_S or now < self._fresh_from_s

    def _toggle_drive(self) -> None:
        if self.controls.hand is not None:
            self.controls.let_go()
        elif self.controls.may_drive():
            self.push_screen(TextScreen(screens.drive_question(self.model.name)), self._drive_if)

    def _drive_if(self, yes: bool | None) -> None:
        if yes:
            self.controls.drive()

    def action_stop(self) -> None:
        """Space, on any screen."""
        self.controls.stop()

    def action_estop(self) -> None:
        """E, on any screen."""
        self.controls.estop()

    def action_interrupt(self) -> None:
        """Ctrl-C, which is a key here."""
        self._end(signal.SIGINT)

    def action_end(self) -> None:
        """End the view."""
        self._end(None)

    # --- the end ---------------------------------------------------------------------------------

    def _restore_terminal(self) -> None:
        """The process continues: take the terminal again, without the keys that waited."""
        if self._ending:
            return  # a thread at the keyboard that begins now would never end
        self._fresh_from_s = math.inf  # some may have been read already: they are old
        with self.suspend():
            pass
        self.call_later(self._take_keys)

    def _take_keys(self) -> None:
        """Keys from now on are new ones, except those still in another queue."""
        self._fresh_from_s = time.monotonic() + RESUMED_S

    def _end(self, number: signal.Signals | None) -> None:
        if not self._ending:
            self._ending = True
            self.ended_by = number
            self.run_worker(self._close(), exit_on_error=False)

    async def _close(self) -> None:
        # The wheels stop while the screen still shows them.
        await asyncio.to_thread(self.controls.close)
        self.exit()


def _speed(teleop: Teleop) -> str:
    try:
        velocity = teleop.velocity
    except WheelwireError:  # out of reach: the robot's limit is unknown
        return f"speed {teleop.speed}"
    return (
        f"speed {teleop.speed}: {velocity.linear_mps:.2f} m/s, {velocity.angular_radps:.1f} rad/s"
    )


def show(
    robot: Robot,
    name: str,
    *,
    recording: Path | None = None,
    seconds: float = 0.0,
    cannot_drive: str = "",
    check_save: Callable[[str], None] = lambda _: None,
) -> signal.Signals | None:
    """Show a robot until a key or a signal ends it; returns that signal.

    Args:
        robot: Is closed by its owner.
        name: For the screen.
        recording: The file, if the robot is one.
        seconds: For how long; 0: until a key ends it.
        cannot_drive: See `Controls`.
        check_save: See `Controls`.

    Raises:
        LinkClosed: The robot is gone for good.
        WheelwireError: The view has failed; what it failed by was printed.
    """
    if recording is None:
        model = Model(name, time.time() - time.monotonic())
    else:
        model = Model(name, offset_us(recording) / 1e6)
    controls = Controls(robot, cannot_drive, check_save)
    source = Source(robot, model, recording)
    app = ViewApp(model, source, controls, seconds=seconds, stays=recording is not None)
    try:
        app.run(mouse=False)
    finally:
        controls.close()
    if app.failure is not None:
        raise app.failure
    if app.return_code:
        raise WheelwireError("the view has failed: use --plain, and report what is printed above")
    return app.ended_by
