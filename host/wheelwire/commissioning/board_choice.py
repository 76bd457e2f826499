"""Which board a robot has: asked until one was chosen."""

from __future__ import annotations

from wheelwire_protocol.board import BoardState
from wheelwire_protocol.codes import Board, Contradiction

from ..board import BoardDescription, chip_of_pins
from ..drivers.base import BaseDriver
from ..drivers.transport_driver import DeviceDriver
from ..errors import CommissioningFailed, GroupUnavailable
from ..files.board import load_board, pictures_directory, shipped_boards
from .inspection import Say
from .questions import KEEP, Person, Question


def choose_board(robot: BaseDriver, person: Person, say: Say) -> None:
    """Ask which board the robot has, and store it there, unless the robot has one confirmed.

    Args:
        robot: A robot without a device that stores boards is left as it is.
        person: Answers `board` with a built-in board's name, or with `keep`, which confirms the
            board that the device believes to be on.
        say: Called with a line on what is done.

    Raises:
        BoardNotKept, DeviceRefused, LinkLost, RequestTimeout: As `DeviceBoard.take_up`.
    """
    if not isinstance(robot, DeviceDriver):
        return
    try:
        state, present = robot.board.read()
    except GroupUnavailable:
        return  # the device has its pins otherwise
    if state is BoardState.STORED and present is not None:
        say(f"board: {present.name}")
        return
    offered = _boards_for(robot.info.device.board)
    picture = next((name for name, board in offered.items() if board == present), None)
    pictures = pictures_directory()
    as_it_is = f"{KEEP}: none, nothing drives"
    if present is not None:
        shown = f", {pictures / picture}.svg" if picture else ""
        as_it_is = f"{KEEP}: it is {present.name}{shown}, as the firmware believes"
    answer = person.answer(
        Question(
            "board",
            f"Which board is it? {pictures}/NAME.svg shows each; {as_it_is}.",
            (*offered, KEEP),
            KEEP,
        )
    )
    chosen = present if answer == KEEP else offered[answer]
    if chosen is None:
        return
    if chosen == present:
        robot.board.accept(chosen)
        say(f"{chosen.name}: confirmed")
    else:
        robot.board.take_up(chosen)
        say(f"{chosen.name}: written, tried and confirmed")


def tell_contradictions(robot: BaseDriver, say: Say) -> None:
    """Name the parameters that contradict each other, or the board.

    Raises:
        CommissioningFailed: There are some: nothing would drive.
    """
    if not isinstance(robot, DeviceDriver):
        return
    active = robot.contradictions()
    for flag in Contradiction:
        if flag in active:
            say(f"contradiction: {flag.doc}")
    if active:
        raise CommissioningFailed(
            "parameters contradict each other, and nothing drives: correct them with "
            "`wheelwire params set`, then begin again"
        )


def _boards_for(chip: Board) -> dict[str, BoardDescription]:
    """The built-in boards for a device's chip, by name."""
    boards = {name: load_board(name) for name in shipped_boards()}
    return {n: board for n, board in boards.items() if board.chip is chip_of_pins(chip)}
