"""The command `wheelwire`: text for people, `--json` for programs, each error on one line."""

from __future__ import annotations

import os
import signal
from types import FrameType

INTERRUPTED = 130


def main() -> None:
    """Entry point of the console script."""
    default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if default:
        # The imports below take some 0.2 s. Ctrl-C meanwhile must not print a traceback from the
        # middle of an import; nothing is open yet, so the process may simply exit.
        signal.signal(signal.SIGINT, _exit_interrupted)
    from .app import run

    if default:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


def _exit_interrupted(_signal: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)
