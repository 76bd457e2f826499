"""Starting other processes from tests."""

from __future__ import annotations

import signal


def interruptible() -> None:
    """For `preexec_fn`: SIGINT interrupts, even where it is ignored here, as in `make test &`."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
