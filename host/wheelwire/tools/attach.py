"""Opens a robot, or attaches to the program that holds it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from ..connect import open_driver
from ..drivers.attached import AttachedDriver
from ..drivers.pin_options import L298NOptions, PigpioDriverOptions
from ..errors import DriverUnavailable, LinkClosed, PortUnavailable
from ..link.ports import port_name
from ..log.share.attached_link import find_holder
from ..pi.settings import McuSettings
from ..robot.robot import Robot

OFFER_S = 2.0
"""How long a program that opened a port may take to offer its link, on a busy computer."""
LOOK_S = 0.02


def open_or_attach(name: str, options: Mapping[str, Any], *, listens: bool = True) -> Robot:
    """Open a robot; if another program holds its port and offers its link, attach to that.

    Args:
        name: As of `open_driver`.
        options: As of `open_driver`, by name.
        listens: See `AttachedDriver`.

    Raises:
        WheelwireError: As `open_driver` and `AttachedDriver`.
    """
    place = _place(name, options)
    attached = place.attached(listens=listens) if place and place.is_slow_to_open else None
    if attached is not None:
        return attached
    try:
        return open_driver(name, **options)
    except (PortUnavailable, DriverUnavailable) as error:
        # A program that has just opened the port offers its link a moment later.
        is_in_use = isinstance(error, PortUnavailable) and error.is_in_use
        within_s = OFFER_S if is_in_use else 0.0
        attached = place and place.attached(listens=listens, within_s=within_s)
        if attached is None:
            raise
        return attached


class _Place(NamedTuple):
    """Where a robot is that only one program can hold."""

    identity: str
    board_id: str = ""
    is_slow_to_open: bool = False
    """Whether it takes long to find out there that another program holds it."""

    def attached(self, *, listens: bool, within_s: float = 0.0) -> AttachedDriver | None:
        """A driver through the program that holds the robot; None if no program offers its link."""
        end_s = time.monotonic() + within_s
        while True:
            holder = find_holder(self.identity, self.board_id)
            if holder is not None:
                with suppress(LinkClosed):  # it has just ended
                    return AttachedDriver(holder, listens=listens)
            if time.monotonic() >= end_s:
                return None
            time.sleep(LOOK_S)


def _place(name: str, options: Mapping[str, Any]) -> _Place | None:
    """Where the robot is; None if each program gets its own robot."""
    if name == "serial":
        port, board_id = port_name(str(options["port"])), str(options.get("board_id") or "").lower()
        # For a board's id all free ports are opened. The peer of a socket lets the second
        # connection wait, or drops the first.
        is_slow = bool(board_id) or port.startswith(("socket://", "unix:"))
        return _Place(port, board_id, is_slow)
    pins = {"l298n": L298NOptions, "pigpio": PigpioDriverOptions}.get(name)
    if pins is None:
        return None
    settings: McuSettings = pins(**options).checked()
    return _Place(settings.identity, is_slow_to_open=True)  # pins are tried again for seconds
