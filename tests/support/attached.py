"""Finding the program that holds a port, from tests that attach to it."""

from __future__ import annotations

from wheelwire.log.share.attached_link import Holder, find_holder

from .waiting import wait_until


def holder_of(port: str, board_id: str | None = None) -> Holder:
    """Who holds a port, or a board, once that offers its link."""
    found: list[Holder] = []

    def is_found() -> bool:
        found.extend(filter(None, [find_holder(port, board_id)]))
        return bool(found)

    wait_until(is_found, what=f"a holder of {port}")
    return found[0]


def wait_for_holder(port: str, board_id: str | None = None) -> None:
    """Return once somebody offers the link."""
    holder_of(port, board_id).connection.close()
