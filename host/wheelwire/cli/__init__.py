"""The command `wheelwire`: human by default, `--json` for machines, one line for an error."""

from __future__ import annotations

import os
import signal
from types import FrameType

INTERRUPTED = 130


def main() -> None:
    """Entry point of the console script."""
    default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if default:  # the imports take a while; nothing is open yet
        signal.signal(signal.SIGINT, _leave)
    from .app import run

    if default:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


def _leave(_signal: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
