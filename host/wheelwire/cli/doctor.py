"""`wheelwire doctor`: what on this computer, or on a robot, will cause trouble.

Its checks it imports itself: other commands start without them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from wheelwire.errors import ProtocolMismatch, WheelwireError

from .address import Address, Given
from .output import console, print_lines, printed_json
from .registry import Heading, command

if TYPE_CHECKING:
    from wheelwire.tools.doctor import Finding

FOUND = 30
"""Exit code if anything was found."""


@command("doctor", Heading.LOOK, 5, page="doctor")
def doctor(given: Given) -> None:
    """Find what causes trouble on this computer, and on ROBOT if one is named; with cures.

    Opens no port that is not named. Exit code 30 if anything was found.
    """
    from wheelwire.tools.doctor import Machine, examine

    found = list(examine(Machine(robot=given.robot or "")))
    if given.robot is not None:
        found += _of_robot(Address(given.robot, given.baud_rate))
    if not printed_json([{**asdict(finding), "page": finding.page} for finding in found]):
        _print(found, given.robot)
    if found:
        raise typer.Exit(FOUND)


def _of_robot(address: Address) -> Iterator[Finding]:
    from wheelwire.tools.doctor import Finding, examine_robot

    try:
        with address.open_to_look() as driver:
            if driver.has_device:
                yield from examine_robot(driver, address.text, address.parameters())
    except ProtocolMismatch as error:
        yield Finding("firmware", f"{error}.", f"wheelwire flash {address.text}")
    # What was found before it went away stays in the list.
    except WheelwireError as error:
        problem, _, cure = str(error).partition(": ")
        yield Finding("no-answer", f"{problem}.", cure or "wheelwire ports")


def _print(found: list[Finding], robot: str | None) -> None:
    for finding in found:
        print_lines(f"{finding.name}: {finding.problem}", style="bold")
        print_lines(f"    {finding.cure}", style="cyan")
        print_lines(f"    {finding.page}")
    if not found:
        of_robot = f", nor with {robot}" if robot else ""
        console.print(f"Nothing is wrong with this computer, as far as it shows{of_robot}.")
