"""The least that an application of Textual does that draws its whole screen four times a second.

A program of its own; `q` ends it.
"""

from __future__ import annotations

from itertools import count

from rich.text import Text
from textual.app import App, ComposeResult
from textual.events import Key
from textual.widgets import Static

PICTURE_S = 0.25
FIRST, PATTERNS = 0x2801, 255
"""Braille characters, as in the plots of the view."""


class Screen(App[None]):
    """Two columns of dots that move."""

    ENABLE_COMMAND_PALETTE = False

    def __init__(self) -> None:
        super().__init__(ansi_color=True)
        self._numbers = count()

    def compose(self) -> ComposeResult:
        """One widget."""
        yield Static(markup=False)

    def on_mount(self) -> None:
        """Begin to draw."""
        self.set_interval(PICTURE_S, self._draw)

    def on_key(self, event: Key) -> None:
        """`q` ends it."""
        if event.key == "q":
            self.exit()

    def _draw(self) -> None:
        number, text = next(self._numbers), Text()
        width = self.size.width // 2 - 6
        for row in range(self.size.height):
            dots = chr(FIRST + (number + row) % PATTERNS) * width
            text.append(f"{row + number:5} ", style="dim").append(dots, style="cyan")
            text.append(f"{row:5} ", style="dim").append(f"{dots}\n", style="magenta")
        self.query_one(Static).update(text)


if __name__ == "__main__":
    Screen().run(mouse=False)
