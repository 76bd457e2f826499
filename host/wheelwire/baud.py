"""Looking for the baud rate of a device that does not answer. Sans-IO."""

from __future__ import annotations

USUAL_RATES = (921_600, 115_200, 460_800, 230_400, 1_000_000, 2_000_000)
FIRST_US = 1_000_000
"""Opening a port may reset an ESP32: it needs this long to answer even at the right rate."""
NEXT_US = 500_000


class BaudSearch:
    """Which rate to try when.

    Args:
        first: The rate in force; None where there is none, and nothing to search.
        now_us: The host's clock.
    """

    def __init__(self, first: int | None, now_us: int) -> None:
        self.tried: list[int] = [] if first is None else [first]
        """In the order of their trial; each once."""
        self._rates = [first, *(rate for rate in USUAL_RATES if rate != first)]
        self._index = 0
        self.due_us: int | None = None if first is None else now_us + FIRST_US
        """When to go on; None: not at all."""

    def next(self, now_us: int) -> int | None:
        """The rate to change to now; None when it is not time yet."""
        if self.due_us is None or now_us < self.due_us:
            return None
        self._index = (self._index + 1) % len(self._rates)
        rate = self._rates[self._index]
        if rate is not None and rate not in self.tried:
            self.tried.append(rate)
        self.due_us = now_us + (NEXT_US if self._index else FIRST_US)
        return rate

    def end(self) -> None:
        """A device answered at the rate in force."""
        self.due_us = None
