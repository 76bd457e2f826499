"""The thread that calls the control loop on time, and reaches for lost pins again."""

from __future__ import annotations

import logging
import threading
import time

from .link import LocalLink

log = logging.getLogger("wheelwire")

RECONNECT_INTERVAL_S = 0.25
JOIN_S = 5.0
"""Longer than any access to the pins may take; the thread is a daemon in any case."""


class ControlThread:
    """Steps a link in real time, from its construction to `close`."""

    def __init__(self, link: LocalLink, name: str) -> None:
        self._link = link
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"wheelwire {name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread, stop the robot, let go of the pins. Harmless when repeated."""
        self._end.set()
        self._link.close()
        if self._thread is not threading.current_thread():
            self._thread.join(JOIN_S)

    def _run(self) -> None:
        try:
            self._pace()
        except Exception as error:
            log.exception("the control loop failed")
            self._link.close(f"the control loop failed: {type(error).__name__}: {error}")

    def _pace(self) -> None:
        due_s = time.monotonic()
        while not self._end.is_set():
            if not self._link.step():
                self._end.wait(RECONNECT_INTERVAL_S)
                self._link.reopen()
                due_s = time.monotonic()
            # From due time to due time: lateness does not add up. No burst after a gap.
            due_s = max(due_s + self._link.period_s, time.monotonic())
            self._end.wait(due_s - time.monotonic())
