"""Makes a forked process let go of what belongs to its parent, above all of open ports.

The child has a copy of every descriptor, so a port would stay locked after the parent closed it.
And the thread that serves the link does not exist in the child.
"""

from __future__ import annotations

import os
from typing import Protocol
from weakref import WeakSet


class Abandonable(Protocol):
    """Something that belongs to the process that created it."""

    def abandon(self) -> None:
        """Release this process's copy without affecting the parent's."""


_held: WeakSet[Abandonable] = WeakSet()


def abandon_in_child(thing: Abandonable) -> None:
    """Abandon `thing` in every child that this process forks, for as long as it exists."""
    _held.add(thing)


def _after_fork_in_child() -> None:
    for thing in list(_held):
        thing.abandon()
    # They are over in this process: a child that it forks has nothing left to abandon.
    _held.clear()


os.register_at_fork(after_in_child=_after_fork_in_child)
