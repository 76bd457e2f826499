"""The command `wheelwire`: text for people, `--json` for programs, each error on one line.

app.py          the list of commands, and the exit code of an error
address.py      ROBOT and --baud-rate: which driver opens it, even while another program holds it
output.py       tables, JSON and notes; prompts.py: questions; help.py: pages of the documentation
interruptions.py     what Ctrl-C ends
robot.py        drive, stop, monitor and the like; the other files are named after their commands
start.py        flash, board, setup and drive, one after the other
local.py        demo, mcu and ports
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130


def main() -> None:
    """Entry point of the console script."""
    default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if default:
        # The imports below take some 0.2 s. Ctrl-C meanwhile must not print a traceback from the
        # middle of an import; nothing is open yet, so the process may simply exit.
        signal.signal(signal.SIGINT, _exit_interrupted)
    # Nothing of theirs is garbage: to search for it again and again takes a tenth of the start.
    gc.disable()
    from .app import run
    from .registry import commands

    commands(*sys.argv[1:2])  # imports their modules
    gc.freeze()
    gc.enable()
    try:
        if default:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        code = run()
    except KeyboardInterrupt:
        # Just before or after the part of `run` that handles it.
        _exit_interrupted(signal.SIGINT, None)
    if default:
        # All is done: an exception in the interpreter's own end would print a traceback.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(code)


def _exit_interrupted(_signal: int, _frame: FrameType | None) -> None:
    line = b"wheelwire: interrupted\n"
    if "--json" in sys.argv:
        line = b'{"error": "Interrupted", "message": "interrupted", "exit_code": 130}\n'
    try:
        os.write(2, line)
    finally:
        os._exit(INTERRUPTED)
