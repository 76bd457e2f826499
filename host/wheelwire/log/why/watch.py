"""Watches a link for stops, while the program drives."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from ...errors import WheelwireError
from ...link.traffic import TrafficReader
from ..recorder import TrafficSource, wait_until_it_began
from .diagnosis import Diagnosis, Stop

PERIOD_S = 0.05
PATIENCE_S = 2.0
_LOG = logging.getLogger("wheelwire.log.why")


class StopWatch:
    """Calls `report` for each stop, in its own thread, until the link ends or `close`.

    The exit of `with` closes it, too.

    The thread takes its copies of the traffic 20 times a second. That costs the link nothing, and
    some 12 us of processor time a record. If its queue overflows, it starts again.

    Args:
        link: To be watched.
        report: What it raises is logged.

    Attributes:
        error: Why it has ended before the link.
    """

    def __init__(self, link: TrafficSource, report: Callable[[Stop], object]) -> None:
        self.error: WheelwireError | None = None
        self._link = link
        self._report = report
        self._closing = threading.Event()
        self._lock = threading.Lock()
        """Guards all attributes below."""
        self._found: list[Stop] = []
        self._begin()
        wait_until_it_began(link, self._reader)
        self._thread = threading.Thread(target=self._run, name="wheelwire stops", daemon=True)
        self._thread.start()

    def latched(self) -> Stop | None:
        """The stop that keeps the robot from driving now, also before it is reported."""
        # A signal handler may ask while the program asks, which would wait for itself.
        if self._closing.is_set() or not self._lock.acquire(timeout=PATIENCE_S):
            return None
        try:
            self._take()
            return None if self.error is not None else self._diagnosis.latched()
        finally:
            self._lock.release()

    def close(self) -> None:
        """Stop watching. Safe to call more than once."""
        self._closing.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def __enter__(self) -> StopWatch:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _begin(self) -> None:
        self._reader = TrafficReader()
        self._diagnosis = Diagnosis()
        self._link.listen_to_traffic(self._reader)

    def _run(self) -> None:
        try:
            while not (self._closing.wait(PERIOD_S) or self._link.has_ended or self.error):
                with self._lock:
                    self._take()
                    found, self._found = self._found, []
                for stop in found:
                    self._tell(stop)
        finally:
            self._link.traffic.remove(self._reader)

    def _take(self) -> None:
        if not self._link.has_ended:
            self.error = self.error or self._reader.failure
        if self.error is not None:
            return
        try:
            records = self._reader.take()
            if self._reader.lost:
                # Behind a gap nothing can be done again.
                self._link.traffic.remove(self._reader)
                self._begin()
                return
            self._found += self._diagnosis.feed_all(records)
        except Exception as error:
            _LOG.exception("the watch for stops has failed; the robot is driven on")
            self.error = WheelwireError(f"the watch for stops has failed ({error!r}): report this")

    def _tell(self, stop: Stop) -> None:
        try:
            self._report(stop)
        except Exception:
            _LOG.exception("the function to call at a stop has failed")
