"""Resets of the device that nobody has acknowledged yet. Needs no rclpy."""

from __future__ import annotations

from wheelwire import BaseDriver, WheelSample

from . import diagnostics

ACKNOWLEDGED_BY = "~/clear_fault acknowledges it"


class ResetWatch:
    """Notices in the samples that the device was reset or replaced, and remembers it.

    A chip that crashes and is back within a second shows in nothing else: whoever looks later
    still has to see it.
    """

    def __init__(self) -> None:
        self.reason = ""
        """Why the device last started, by name; empty while nothing happened."""
        self.count = 0
        """Resets that nobody has acknowledged."""
        self.text = ""
        """One sentence for a person; empty while nothing happened."""
        self.board_id = ""
        """Of the device that sent the last sample; empty where the driver does not tell."""
        self._boot_id: int | None = None

    def note(self, sample: WheelSample, robot: BaseDriver) -> bool:
        """Look at the next sample; whether it is the first after a reset."""
        if sample.boot_id == self._boot_id:
            return False
        is_first = self._boot_id is None
        self._boot_id = sample.boot_id
        # Samples begin after the hello, so what the driver knows is of this boot.
        reason, doc, board_id = diagnostics.last_start(robot)
        replaced, self.board_id = board_id != self.board_id, board_id
        if is_first:
            return False
        self.count += 1
        self.reason = reason
        if replaced:
            self.text = f"another device was connected: {board_id}; {ACKNOWLEDGED_BY}"
        else:
            times = f" ({self.count} times)" if self.count > 1 else ""
            self.text = f"the device was reset{times}: {reason}, {doc}; {ACKNOWLEDGED_BY}"
        return True

    def acknowledge(self) -> None:
        """Forget what happened so far."""
        self.count, self.reason, self.text = 0, "", ""
