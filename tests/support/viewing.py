"""A view of a robot without a terminal, at whose keyboard a test sits."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

from textual.pilot import Pilot
from textual.widgets import DataTable

from wheelwire.robot.robot import Robot
from wheelwire.tools.view.app import ViewApp
from wheelwire.tools.view.controls import Controls
from wheelwire.tools.view.model import Model
from wheelwire.tools.view.screens import Panel
from wheelwire.tools.view.source import Source

TIMEOUT_S = 20.0
HELD_S = 0.1
"""Between two repeats of a held key."""


class Viewing:
    """What a test does at the keyboard, and sees."""

    def __init__(self, app: ViewApp, pilot: Pilot[None]) -> None:
        self.app = app
        self.press = pilot.press
        self._pilot = pilot

    @property
    def screen(self) -> str:
        """The text of the screen, part by part."""
        screen = self.app.screen
        return "\n".join(panel.render().plain for panel in screen.query(Panel))

    @property
    def events(self) -> list[str]:
        return [event.text for event in self.app.model.events]

    def value_of(self, name: str) -> str:
        """In the table of the parameters."""
        table: DataTable[Any] = self.app.screen.query_one(DataTable)
        return str(table.get_row(name)[1])

    async def until(self, holds: Callable[[], object]) -> None:
        """Wait until it holds."""
        end = time.monotonic() + TIMEOUT_S
        while not holds():
            assert time.monotonic() < end, f"{self.screen}\n{self.events}"
            await self._pilot.pause(0.05)

    async def sees(self, text: str) -> None:
        """Wait until the screen shows a text."""
        await self.until(lambda: self.shows(text))

    def shows(self, text: str) -> bool:
        return text in " ".join(self.screen.split())

    async def hears(self, text: str) -> None:
        """Wait for an event that has a text."""
        await self.until(lambda: any(text in event for event in self.events))

    async def drives(self, key: str = "w", until: str = "DRIVING") -> None:
        """Hold a key until the screen shows a text, by default that the robot drives."""

        async def hold() -> None:
            while not self.shows(until):
                await self.press(key)
                await asyncio.sleep(HELD_S)

        await asyncio.wait_for(hold(), TIMEOUT_S)


@asynccontextmanager
async def viewing(
    robot: Robot, size: tuple[int, int] = (80, 24), recording: Path | None = None, **options: Any
) -> AsyncIterator[Viewing]:
    """A view of a robot, which is quit at the end."""
    model = Model("robot", time.time() - time.monotonic())
    controls = Controls(robot, **options)
    source = Source(robot, model, recording)
    app = ViewApp(model, source, controls, stays=recording is not None)
    with closing(controls):
        async with app.run_test(size=size) as pilot:
            at = Viewing(app, pilot)
            await at.until(lambda: model.sample)
            yield at
            app.action_end()
            await at.until(lambda: not app.is_running)
