"""Write the view's screens, by a simulated robot in virtual time: the same at every run.

docs/monitor.svg is one of them, a block of text in docs/view.md the other.

tools/write_view.py            writes the page and the picture
tools/write_view.py --check    fails when it is not what the view shows
"""

from __future__ import annotations

import asyncio
import math
import os
import re
import sys
import time
from contextlib import suppress
from typing import cast

import generated
from wheelwire.connect import open_driver
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.errors import DeviceRefused
from wheelwire.tools.view.app import LOOK_S, LOOKS_PER_PICTURE, ViewApp
from wheelwire.tools.view.controls import Controls
from wheelwire.tools.view.model import Model
from wheelwire.tools.view.screens import Panel
from wheelwire.tools.view.source import Source

PAGE = generated.ROOT / "docs" / "view.md"
PICTURE = generated.ROOT / "docs" / "monitor.svg"
REMOTE_FONTS = re.compile(r"\s*@font-face \{.*?\}", re.DOTALL)
TEN_O_CLOCK_S = 36_000.0
"""The robot's clock at zero, since 1970."""
SECONDS = 22.0
BLOCKED_S = 20.0
"""When the left wheel is held."""


class Still(Source):
    """Looks no more."""

    def look(self) -> None:
        """Do not look again."""


def story(robot: VirtualMockDriver, model: Model, seconds: float) -> Still:
    """A winding way there and back, until the left wheel is held."""
    source = Source(robot, model)
    for number in range(round(seconds / LOOK_S)):
        now_s = number * LOOK_S
        if now_s >= BLOCKED_S:
            robot.simulator.set("left.blocked", 1)
        with suppress(DeviceRefused):  # behind the fault
            robot.set_velocity(0.25 * math.sin(now_s / 2), 0.6 * math.sin(now_s), ttl=0.3)
        robot.advance(LOOK_S)
        source.look()
    return Still(robot, model)


def screen(columns: int, rows: int, seconds: float) -> tuple[str, str]:
    """The view's screen after this many seconds, as text and as SVG."""
    model = Model("my_robot.yaml", TEN_O_CLOCK_S)
    with cast("VirtualMockDriver", open_driver("mock", realtime=False)) as robot:
        app = ViewApp(model, story(robot, model, seconds), Controls(robot))
        lines, picture = asyncio.run(shown(app, (columns, rows)))
    return "\n".join(["```text", *(line.rstrip() for line in lines), "```", ""]), picture


async def shown(app: ViewApp, size: tuple[int, int]) -> tuple[list[str], str]:
    """The lines of an application's screen, and a picture of it."""
    async with app.run_test(size=size) as pilot:
        for _ in range(LOOKS_PER_PICTURE):
            await pilot.pause(LOOK_S)
        lines = [""] * size[1]
        for panel in app.screen.query(Panel):
            region = panel.region
            text = panel.render().plain.split("\n")[: region.height]
            lines[region.y : region.y + len(text)] = text
        # Inside a page, a picture cannot fetch fonts from elsewhere.
        picture = REMOTE_FONTS.sub("", app.export_screenshot(title="wheelwire monitor"))
    return lines, picture


def main() -> str | None:
    """Write or check the page."""
    os.environ["TZ"] = "UTC"
    time.tzset()
    _, picture = screen(80, 24, BLOCKED_S)
    fault, _ = screen(60, 20, SECONDS)
    page = generated.filled(PAGE, {"fault": fault})
    return generated.write({PAGE: page, PICTURE: picture})


if __name__ == "__main__":
    sys.exit(main())
