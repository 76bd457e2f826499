"""Looking for the baud rate of a device that does not answer. Sans-IO."""

from __future__ import annotations

USUAL_RATES = (921_600, 115_200, 460_800, 230_400, 1_000_000, 2_000_000)
FIRST_US = 1_000_000
"""Opening a port may reset an ESP32: it needs this long to answer even at the right rate."""
NEXT_US = 500_000
ROUND_US = FIRST_US + (len(USUAL_RATES) - 1) * NEXT_US
"""A round where there is no rate to change: nothing but opening the port anew can help."""


class BaudSearch:
    """Which rate to try when.

    Args:
        first: The rate in force; None where there is none, and nothing to try.
        now_us: The host's clock.
    """

    def __init__(self, first: int | None, now_us: int) -> None:
        self.rate = first
        """The first of each round: the one at which a device answered last, or was expected to."""
        self.tried: list[int] = []
        """In the order of their trial; each once."""
        self.over = False
        """No rate of the round was answered: it is time to open the port anew."""
        self._waiting: list[int] = []
        self._due_us: int | None = None
        self.begin(now_us)

    def begin(self, now_us: int) -> None:
        """The port was opened, at `rate`: a round begins."""
        self.over = False
        if self.rate is None:
            self._due_us = now_us + ROUND_US
            return
        self._waiting = [rate for rate in USUAL_RATES if rate != self.rate]
        self._due_us = now_us + FIRST_US
        self._note(self.rate)

    def next(self, now_us: int) -> int | None:
        """The rate to change to now; None when it is not time yet, or the round is over."""
        if self._due_us is None or now_us < self._due_us:
            return None
        if not self._waiting:
            self.over = True
            return None
        self._due_us = now_us + NEXT_US
        rate = self._waiting.pop(0)
        self._note(rate)
        return rate

    def end(self, rate: int | None) -> None:
        """A device answered at the rate in force."""
        self.rate = rate
        self._due_us = None

    def _note(self, rate: int) -> None:
        if rate not in self.tried:
            self.tried.append(rate)


REST_US = 10_000
"""How long. At 5000 frames a second 2500 bytes come meanwhile; a terminal's buffer holds 4095."""


class Coalescing:
    """Tells a fast stream, of which a rest brings several frames, from a slow one."""

    def __init__(self) -> None:
        self.rest_until_us = 0
        """When to read again; in the past for a slow stream: each frame is read when it comes."""
        self._frames = 0
        self._read_us = 0

    def note_read(self, frames: int, now_us: int) -> None:
        """Something was read; `frames` counts all since the start."""
        fast = frames > self._frames + 1 or now_us - self._read_us < REST_US // 2
        self._frames, self._read_us = frames, now_us
        self.rest_until_us = now_us + REST_US if fast else 0
