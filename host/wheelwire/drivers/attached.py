"""The driver of a robot whose port another program holds: it reads, stops and e-stops."""

from __future__ import annotations

from functools import partial

from ..log.share.attached_link import AttachedLink, Holder
from ..robot.robot import Robot


class AttachedDriver(Robot):
    """A robot beside the program that holds its port, and alone drives, sets and clears.

    Closing it does not stop the robot.

    Args:
        holder: The program that holds the port.
        listens: False for a stop alone: nothing else can be read then.

    Attributes:
        holder: The program that holds the port.

    Raises:
        LinkLost: The program says nothing.
    """

    def __init__(self, holder: Holder, *, listens: bool = True) -> None:
        self.holder = holder
        super().__init__(partial(AttachedLink, holder=holder, listens=listens))
