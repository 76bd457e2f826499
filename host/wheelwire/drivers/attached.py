"""The driver of a robot whose port another program holds: it reads, stops and e-stops."""

from __future__ import annotations

from functools import partial

from ..log.share.attached_link import AttachedLink, Holder
from ..robot.robot import Robot


class AttachedDriver(Robot):
    """A robot whose port another program holds. Only that program drives, sets and clears.

    Closing it does not stop the robot.

    Args:
        holder: The program that holds the port.
        listens: False only to stop: nothing can be read then.

    Attributes:
        holder: The program that holds the port.

    Raises:
        LinkLost: The program does not answer.
    """

    def __init__(self, holder: Holder, *, listens: bool = True) -> None:
        self.holder = holder
        super().__init__(partial(AttachedLink, holder=holder, listens=listens))
