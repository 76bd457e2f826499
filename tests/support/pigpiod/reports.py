"""Reports of levels to a client: sampled, in batches, and lost if the client does not read."""

from __future__ import annotations

import socket
from collections import deque
from contextlib import suppress

import numpy as np
import numpy.typing as npt

SAMPLE_US = 5
BUFFER_US = 120_000
REPORT = np.dtype([("seq", "<u2"), ("flags", "<u2"), ("t_us", "<u4"), ("levels", "<u4")])
Samples = npt.NDArray[np.void]
"""Records of REPORT, without their numbers."""


def make_samples(t_us: npt.ArrayLike, levels: npt.ArrayLike) -> Samples:
    """One for each time."""
    times = np.asarray(t_us, np.int64)
    samples = np.zeros(times.size, REPORT)
    samples["t_us"] = times & 0xFFFFFFFF
    samples["levels"] = levels
    return samples


class Notification:
    """One open in-band handle."""

    def __init__(self, connection: socket.socket) -> None:
        self.bits = 0
        self._connection = connection
        self._sequence = 0
        self._pending: deque[tuple[int, bytes]] = deque()
        self._unsent = b""

    def add(self, samples: Samples, now_us: int) -> None:
        """Number the reports and queue them for the client."""
        samples["seq"] = np.arange(self._sequence, self._sequence + samples.size) & 0xFFFF
        self._sequence += samples.size
        self._pending.append((now_us, samples.tobytes()))

    def flush(self, now_us: int) -> None:
        """Send what the connection accepts; reports that waited longer than the buffer are lost."""
        while self._pending and now_us - self._pending[0][0] > BUFFER_US:
            self._pending.popleft()
        if not self._unsent:
            self._unsent = b"".join(chunk for _, chunk in self._pending)
            self._pending.clear()
        if self._unsent:
            with suppress(OSError):  # BlockingIOError is one: the client is slow
                sent = self._connection.send(self._unsent, socket.MSG_DONTWAIT)
                self._unsent = self._unsent[sent:]


class Sampler:
    """Turns edges into samples: levels that change more than once within 5 us are seen once."""

    def __init__(self, levels: int) -> None:
        self.levels = levels

    def sample(self, edges: npt.NDArray[np.void]) -> Samples:
        """Take edges in their order; returns the samples that show a change."""
        if not edges.size:
            return make_samples([], [])
        # Each edge is a change of its level.
        levels = np.bitwise_xor.accumulate(1 << edges["gpio"].astype(np.int64)) ^ self.levels
        t_us = edges["t_ns"].astype(np.int64) // 1000 // SAMPLE_US * SAMPLE_US
        last = np.append(t_us[1:] != t_us[:-1], True)
        t_us, levels = t_us[last], levels[last]
        changed = levels != np.append(self.levels, levels[:-1])
        self.levels = int(levels[-1])
        return make_samples(t_us[changed], levels[changed])
