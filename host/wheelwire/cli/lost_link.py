"""What commands do when the link to the robot is lost: wait for it, or end and say what to do."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from wheelwire.drivers.base import BaseDriver
from wheelwire.errors import LinkClosed, LinkLost, RequestTimeout
from wheelwire.samples import WheelSample

SLICE_S = 0.2
"""How long one wait for a sample lasts at most, so that its caller can end in between."""
SILENT_S = 1.0
"""Without a sample for so long, a robot is called silent."""


class LinkNews(NamedTuple):
    """The link was lost, or is back."""

    is_lost: bool
    text: str


def watch(
    robot: BaseDriver,
    until: float,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[WheelSample | LinkNews]:
    """The newest samples until `until`, a time of `now`; goes on when a lost link is back.

    A loss is told once, and so is the first sample after it.

    Raises:
        LinkClosed: The driver was closed, or its link has failed for good.
    """
    is_lost = False
    heard = now()
    while (moment := now()) < until:
        try:
            sample = robot.read(min(SLICE_S, until - moment))
        except LinkClosed:
            raise
        except (LinkLost, RequestTimeout) as error:
            silent = isinstance(error, RequestTimeout)
            if not is_lost and (not silent or now() - heard >= SILENT_S):
                is_lost = True
                yield LinkNews(True, "the robot sends nothing; waiting" if silent else str(error))
            # Some losses are reported at once, and would be asked for again and again.
            sleep(max(0.0, min(SLICE_S, until - now()) - (now() - moment)))
            continue
        heard = now()
        if is_lost:
            is_lost = False
            yield LinkNews(False, "the link is back")
        yield sample


@contextmanager
def ended_by_a_loss() -> Iterator[None]:
    """Say of a lost link that it ends the command, and what to do; not that it is waited for."""
    try:
        yield
    except LinkLost as error:
        if type(error) is not LinkLost:
            raise  # another board, or closed: its message says what to do
        reason = str(error).partition(";")[0]
        raise LinkLost(
            f"{reason}; the robot stops by itself when its last setpoint expires: check cable and "
            "power, then run the command again"
        ) from error
