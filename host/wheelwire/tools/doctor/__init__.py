"""What will cause trouble on a computer and its robot: each finding with its cure.

A check is a function that yields findings. Those of a computer read a `Machine`: files below /sys,
/proc, /dev and /etc, the environment, the answers of a few commands. None opens a port.
"""

from __future__ import annotations

from collections.abc import Iterator

from . import computer, ports, ros
from .finding import Finding
from .machine import Machine
from .robot import examine_robot

__all__ = ["Finding", "Machine", "examine", "examine_robot"]


def examine(machine: Machine) -> Iterator[Finding]:
    """What is wrong with a computer."""
    for check in (*ports.CHECKS, *computer.CHECKS, *ros.CHECKS):
        yield from check(machine)
