"""The screens: the robot, help, the question before driving, the parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, cast

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.coordinate import Coordinate
from textual.events import Key, Resize
from textual.geometry import Size
from textual.screen import ModalScreen, Screen
from textual.widget import Widget
from textual.widgets import DataTable, Input, Static

from wheelwire_protocol.codes import SupervisorState

from ...parameters import number_text
from ..teleop.drive import SPEEDS
from . import panels

if TYPE_CHECKING:
    from .app import ViewApp

KEYS = (
    ("space", "stop"),
    ("e", "e-stop"),
    ("c", "clear"),
    ("p", "parameters"),
    ("t", "drive"),
    ("r", "record"),
    ("?", "help"),
    ("q", "quit"),
)
LOOKING_KEYS = tuple(key for key in KEYS if key[0] not in "ctr")
RECORDING_KEYS = tuple(key for key in KEYS if key[0] in "p?q")
DRIVING_KEYS = (
    ("w a s d, arrows", "drive"),
    ("+ - 1..9 0", "speed"),
    ("space", "stop"),
    ("e", "e-stop"),
    ("c", "clear"),
    ("t, esc", "stop driving by keys"),
    ("q", "quit"),
)
TUNING_KEYS = (
    ("enter", "change"),
    ("u", "undo"),
    ("r", "revert all"),
    ("s", "save"),
    ("esc", "back"),
    ("space", "stop"),
    ("e", "e-stop"),
)
STATE_LINES, MIN_EVENTS = 3, 3
OTHER_LINES = 8
"""Rows of a screen of 80 columns, without the plots and the events."""
HELP = """\
space  stop, and e e-stop: on every screen
c      clear e-stop or fault once its cause is gone
p      parameters: a change is active at once, on trial;
       the end of the link or the view reverts it
t      drive by w a s d or the arrows, + - 1..9 0 speed;
       hold a key to keep driving; t or esc: no more
r      record to a file in this folder; again: end it
q      quit: what is driven from here stops

asked  the newest setpoint: the dots
duty   on the motor, -1 to 1
loss   of frames to this computer: last second, and all
clock  how well the robot's clock is known

Beside a program that holds the port this view only
looks, stops and e-stops.
Any key goes back."""
"""Fits 60 columns and 20 rows."""


class Panel(Widget):
    """A part of the screen.

    Args:
        draw: Gives the text for a width and a height.
        id: See Textual.
    """

    def __init__(self, draw: Callable[[int, int], Text], id: str | None = None) -> None:  # noqa: A002 - Textual's
        super().__init__(id=id)
        self._draw = draw
        self._text = Text()

    def show(self) -> None:
        """Draw again, if anything has changed."""
        text = self._draw(self.size.width, self.size.height)
        if text != self._text:
            lines = self._text.plain.count("\n")
            self._text = text
            is_auto = self.styles.height is not None and self.styles.height.is_auto
            self.refresh(layout=is_auto and text.plain.count("\n") != lines)

    def render(self) -> Text:
        """As Textual wants it."""
        return self._text

    def get_content_height(self, container: Size, viewport: Size, width: int) -> int:  # noqa: ARG002
        """As Textual wants it."""
        return self._draw(width, 0).plain.count("\n") + 1

    def on_resize(self, _: Resize) -> None:
        """The width or height is another one."""
        self.show()


class _ViewScreen(Screen[None]):
    @property
    def view(self) -> ViewApp:
        """The application."""
        return cast("ViewApp", self.app)


class RobotScreen(_ViewScreen):
    """What the robot does."""

    def compose(self) -> ComposeResult:
        """The panels, from the top."""
        view = self.view
        model = view.model
        yield Panel(lambda width, _: panels.title(model, view.modes(), width), "title")
        yield Panel(lambda *size: panels.state(model, *size), "state")
        yield Panel(lambda *size: panels.wheel(model, panels.LEFT, *size), "left")
        yield Panel(lambda *size: panels.wheel(model, panels.RIGHT, *size), "right")
        yield Panel(lambda width, _: panels.axis(width), "axis")
        yield Panel(lambda width, _: panels.link(model, width), "link")
        yield Panel(lambda *size: panels.events(model, *size), "events")
        yield Panel(lambda width, _: panels.keys(view.keys(), width), "keys")

    def show(self) -> None:
        """Draw what has changed."""
        self._arrange(self.size)
        for panel in self.query(Panel):
            panel.show()

    def on_resize(self, event: Resize) -> None:
        """The terminal has another size."""
        self._arrange(event.size)

    def _arrange(self, size: Size) -> None:
        """The plots keep their height; a long reason takes lines from the events."""
        if not self.children:  # not composed yet
            return
        longest = max(STATE_LINES, size.height // 5)
        reason = panels.state(self.view.model, size.width, longest)
        self._set_height("#state", max(STATE_LINES, reason.plain.count("\n") + 1))
        events = max(MIN_EVENTS, size.height // 6)
        wheel = max(2, (size.height - OTHER_LINES - events) // 2)
        for name in ("#left", "#right"):
            self._set_height(name, wheel)

    def _set_height(self, name: str, height: int) -> None:
        widget = self.query_one(name)
        if widget.size.height != height:  # setting it costs a layout
            widget.styles.height = height

    def on_key(self, event: Key) -> None:
        """A key that the application does not use."""
        event.stop()  # or the screen that it opens would get it, too
        self.view.press(event.key, event.character or "")


class TextScreen(ModalScreen[bool]):
    """A text in front of everything; any key closes it, and `y` returns True.

    Args:
        text: To be shown.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self._text = text
        self._is_closing = False
        """Keys that were typed behind the one that closes it still come here."""

    def compose(self) -> ComposeResult:
        """The text."""
        yield Static(self._text, markup=False, id="text")

    def on_key(self, event: Key) -> None:
        """Any key closes it."""
        event.stop()
        if not self._is_closing:
            self._is_closing = True
            self.dismiss(event.character in ("y", "Y"))


class ParametersScreen(_ViewScreen):
    """The robot's parameters; changed ones are on trial."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("u", "tune('undo')"),
        Binding("r", "tune('revert')"),
        Binding("s", "tune('save')"),
        Binding("escape,p,q", "back"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._shown: dict[str, str] = {}
        self._is_ready = False
        """The table is there."""
        self._is_closing = False
        """As of `TextScreen`."""

    def compose(self) -> ComposeResult:
        """The table, what is known of the line with the cursor, and what has happened."""
        view = self.view
        yield Panel(lambda width, _: panels.title(view.model, view.modes(), width), "title")
        yield Panel(lambda width, _: panels.state(view.model, width, 1), "state1")
        yield DataTable[str](cursor_type="row", zebra_stripes=False, id="table")
        yield Panel(self._explain, "explain")
        yield Input(restrict=r"[-+0-9.,]*", id="value", compact=True)
        yield Panel(lambda *size: panels.events(view.model, *size), "events2")
        yield Panel(lambda width, _: panels.keys(TUNING_KEYS, width), "keys")

    def on_mount(self) -> None:
        """Ask for all values."""
        self._input.display = False
        self._table.add_columns("parameter", "value", "unit", "default")
        self._is_ready = True
        self.view.controls.tune(self.view.controls.tuning.read)

    @property
    def _table(self) -> DataTable[str]:
        return cast("DataTable[str]", self.query_one("#table"))

    @property
    def _input(self) -> Input:
        return self.query_one("#value", Input)

    @property
    def _selected(self) -> str | None:
        """The name in the line with the cursor."""
        names = list(self._shown)
        row = self._table.cursor_row
        return names[row] if 0 <= row < len(names) else None

    def show(self) -> None:
        """Draw what has changed."""
        if not self._is_ready:
            return
        tuning, table = self.view.controls.tuning, self._table
        for row, (name, info) in enumerate(tuple(tuning.infos.items())):
            text = number_text(tuning.values[name])
            before = tuning.changed.get(name)
            if before is not None:
                text += f" on trial, was {number_text(before)}"
            elif name in tuning.unsaved:
                text += " not saved"
            if name not in self._shown:
                table.add_row(name, text, info.unit, number_text(info.default), key=name)
            elif self._shown[name] != text:
                table.update_cell_at(Coordinate(row, 1), text, update_width=True)
            self._shown[name] = text
        for panel in self.query(Panel):
            panel.show()

    def _explain(self, width: int, height: int) -> Text:
        name = self._selected
        if name is None:
            return Text("waiting for the values")
        info = self.view.controls.tuning.infos[name]
        bounds = f"{number_text(info.minimum)} to {number_text(info.maximum)} {info.unit}".rstrip()
        return panels.paragraph(f"{name}, {bounds}: {info.doc}", width, height)

    def on_data_table_row_selected(self, _: DataTable.RowSelected) -> None:
        """Enter on a line: change it."""
        name = self._selected
        if name is None or not self.view.controls.may_act():
            return
        now = number_text(self.view.controls.tuning.values[name])
        self._input.value = ""
        self._input.placeholder = f"a new value for {name}, which is {now}"
        self._input.display = True
        self._input.focus()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Enter in the value: try it."""
        name, tuning = self._selected, self.view.controls.tuning
        self._end_input()
        if name is not None and event.value:
            self.view.controls.tune(lambda: tuning.set(name, event.value))

    def _end_input(self) -> None:
        self._input.display = False
        self._table.focus()

    def action_tune(self, name: str) -> None:
        """Undo, revert or save."""
        controls = self.view.controls
        if name == "save" and self.view.model.state is SupervisorState.DRIVING:
            self.view.model.say("parameters are saved only while the robot stands: space stops it")
            return
        controls.tune(getattr(controls.tuning, name))

    def action_back(self) -> None:
        """Go back to the value's line, or to the robot."""
        if self._input.display:
            self._end_input()
        elif not self._is_closing:
            self._is_closing = True
            self.dismiss()


def drive_question(robot: str) -> str:
    """The question before driving."""
    return (
        f"Drive {robot} by keys? Its wheels may move.\n\n"
        "w a s d or the arrows drive, while a key is held.\n"
        "space stops, e latches an e-stop.\n"
        f"+ and -, or 1 to 9 and 0, set the speed, in {SPEEDS} steps.\n\n"
        "y drives, any other key does not."
    )
