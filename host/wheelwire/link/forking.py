"""What a forked process must not keep of its parent's: open ports above all.

The child has a copy of every descriptor. A port would stay locked after the parent closed it, and
no thread is left there to serve what looks like an open link.
"""

from __future__ import annotations

import os
from typing import Protocol
from weakref import WeakSet


class Abandonable(Protocol):
    """Something that belongs to the process that made it."""

    def abandon(self) -> None:
        """Give up this process's copy. The parent's must not notice."""


_held: WeakSet[Abandonable] = WeakSet()


def abandon_in_child(thing: Abandonable) -> None:
    """Have `thing` given up in every child that this process forks, until it is forgotten."""
    _held.add(thing)


def _after_fork_in_child() -> None:
    for thing in list(_held):
        thing.abandon()
    _held.clear()


os.register_at_fork(after_in_child=_after_fork_in_child)
