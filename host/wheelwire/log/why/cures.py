"""The commands that end a fault of what the device has stored."""

from __future__ import annotations

from wheelwire_protocol.codes import Fault

STORED = Fault.NO_BOARD | Fault.STORE_UNREADABLE | Fault.STORE_OUTDATED
"""What is stored cannot be used: each start finds it anew, until it is written anew."""


def cure_of_stores(faults: Fault, robot: str) -> str:
    """The commands that end these faults, in their order; empty if they are none of `STORED`.

    Args:
        faults: Those that are latched.
        robot: The robot's address, as a command takes it.
    """
    if not faults & STORED:
        return ""
    steps = []
    if Fault.NO_BOARD in faults:
        steps.append(f"`wheelwire board write {robot} FILE` with the file of its board")
    if faults & ~Fault.NO_BOARD & STORED:
        steps.append(
            f"`wheelwire params import {robot} FILE --save`, or `wheelwire params reset {robot}` "
            "for the defaults"
        )
    return ", then ".join((*steps, f"`wheelwire clear {robot}`"))
