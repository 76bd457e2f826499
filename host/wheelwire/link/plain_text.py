"""Plain text that arrives in place of frames: why a chip does not run, or why a bridge refuses."""

from __future__ import annotations

import re
from typing import NamedTuple

TAIL = 1024
"""Bytes that are searched together, because a text may arrive in parts."""
LEAST = 12
"""Printable characters in a line that is worth quoting."""


class _Kind(NamedTuple):
    pattern: str
    sentence: str
    """Its meaning, and what to do about it."""


_KINDS = (
    _Kind(
        r"(?i:brown[-_]?out)",
        "the chip's supply dips each time it starts (a brown-out): power it through a short, thick "
        "USB cable or a stronger supply, and disconnect the motors meanwhile",
    ),
    _Kind(
        r"waiting for download|DOWNLOAD_BOOT|DOWNLOAD\(",
        "the chip waits for a download: release BOOT and press EN (reset); if it comes again, "
        "something that is wired to the BOOT pin pulls it low",
    ),
    _Kind(
        r"invalid header: 0x[0-9a-fA-F]+|flash read err|No bootable app|csum err",
        "the chip finds no firmware in its flash: run `wheelwire flash`",
    ),
    _Kind(
        r"Guru Meditation Error|abort\(\) was called",
        "the firmware on the chip crashes as it starts: run `wheelwire flash`",
    ),
    _Kind(
        r"already in use|is busy|in use by|[Tt]oo many (?:clients|connections|sessions)"
        r"|[Cc]onnection (?:refused|limit)|[Aa]ccess denied|[Nn]ot authori[sz]ed",
        "the bridge at the other end refuses: end the program that uses it, or admit this computer",
    ),
    _Kind(
        r"MicroPython|CircuitPython",
        "the board runs Python, not the firmware: run `wheelwire flash`",
    ),
)
# `re` compiles them once, at the first text: most devices answer before they send any.
_KNOWN = "|".join(f"({kind.pattern})" for kind in _KINDS)
_LINE = rf"[ -~\t]{{{LEAST},}}"


class PlainText:
    """Looks for text in what arrives while no device answers.

    Attributes:
        sentence: What the newest known text means, with its cure; empty if none came.
        quote: The newest line of text, known or not; empty if none came.
    """

    def __init__(self) -> None:
        self.sentence = self.quote = ""
        self._tail = ""

    def feed(self, data: bytes) -> bool:
        """Look at what has arrived; returns whether `sentence` has changed."""
        before = self.sentence
        # Latin-1 maps each byte to a character, so noise cannot fail to decode and matches nothing.
        new = data.decode("latin-1")[-TAIL:]
        self._tail = (self._tail + new)[-TAIL:]
        # Only from where the line begins that the new bytes continue: earlier ones are done.
        begin = len(self._tail) - len(new)
        while begin > 0 and (self._tail[begin - 1].isprintable() or self._tail[begin - 1] == "\t"):
            begin -= 1
        for found in re.finditer(_KNOWN, self._tail[begin:], re.ASCII):
            self.sentence = _KINDS[(found.lastindex or 1) - 1].sentence
            self.quote = self._line_at(begin + found.start(), begin + found.end())
        if not self.sentence and (lines := re.findall(_LINE, self._tail[begin:])):
            self.quote = lines[-1].strip()[:80]
        return self.sentence != before

    def _line_at(self, begin: int, end: int) -> str:
        text = self._tail
        while begin > 0 and text[begin - 1].isprintable():
            begin -= 1
        while end < len(text) and text[end].isprintable():
            end += 1
        return text[begin:end].strip()[:80]
