"""The command `wheelwire`: human by default, `--json` for machines, one line for an error.

Exit codes: 0 done; 2 wrong usage; 130 interrupted; else the error's, see `wheelwire.errors`.
"""

from __future__ import annotations

import sys

import typer

from wheelwire.errors import WheelwireError

from .flash import flash
from .local import demo, ports, sim
from .mcu import mcu
from .output import print_error
from .parameters import app as parameters_app
from .robot import clear, drive, estop, info, monitor

app = typer.Typer(
    name="wheelwire",
    help="Drive, watch and set up a Wheelwire robot.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
for command in (sim, ports, info, drive, monitor, estop, clear, flash, demo, mcu):
    app.command()(command)
app.add_typer(parameters_app, name="params")

INTERRUPTED = 130


def main() -> None:
    """Entry point of the console script."""
    try:
        app(standalone_mode=True)
    except WheelwireError as error:
        print_error(error)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except BrokenPipeError:
        sys.exit(0)  # `wheelwire monitor | head` is no failure
