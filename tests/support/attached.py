"""Finding the program that holds a port, from tests that attach to it."""

from __future__ import annotations

from wheelwire.log.share.attached_link import Holder, find_holder

from .waiting import wait_until


def holder_of(port: str, board_id: str | None = None) -> Holder:
    """Who holds a port, or a board, once that offers its link."""
    return wait_until(lambda: find_holder(port, board_id), what=f"a holder of {port}")


def wait_for_holder(port: str, board_id: str | None = None) -> None:
    """Return once somebody offers the link."""
    holder_of(port, board_id).connection.close()
