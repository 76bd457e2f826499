"""The application with all commands, and its exit codes.

0 done; 2 wrong usage; 130 interrupted; else the error's `exit_code`, see `wheelwire.errors`.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import Annotated

import typer

from wheelwire import __version__
from wheelwire.errors import OutputFailed, WheelwireError

from . import INTERRUPTED
from .board import app as board_app
from .flash import flash
from .local import demo, ports, sim
from .mcu import mcu
from .output import UsageError, print_error, show_help_alone
from .parameter_files import app as parameters_app
from .prompts import use_read_line
from .robot import clear, drive, estop, info, monitor
from .setup import setup
from .teleop import teleop

USAGE = 2
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)

app = typer.Typer(
    name="wheelwire",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (sim, ports, setup, info, drive, teleop, monitor, estop, clear, flash, demo, mcu):
    app.command()(command)
app.add_typer(parameters_app, name="params")
app.add_typer(board_app, name="board")


@app.callback(invoke_without_command=True)
def wheelwire(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """Drive, watch and set up a Wheelwire robot."""
    if version:
        typer.echo(f"wheelwire {__version__}")
        raise typer.Exit
    show_help_alone(context)


def run() -> None:
    """Run the command line, and exit."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # print ? on an ASCII terminal, do not fail
    use_read_line()
    sys.exit(_result(sys.argv[1:]))


def _result(arguments: list[str]) -> int:
    # Not from the parsed options: the error may be that they cannot be parsed.
    as_json = "--json" in arguments
    try:
        return _run_app(arguments)
    except WheelwireError as error:
        print_error(str(error), type(error).__name__, error.exit_code, as_json=as_json)
        return error.exit_code
    except UsageError as error:
        print_error(_usage(error), "UsageError", USAGE, as_json=as_json)
        return USAGE
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED


def _run_app(arguments: list[str]) -> int:
    try:
        # Not standalone: there Click would print errors in a form of its own, and exit.
        code = app(arguments, prog_name="wheelwire", standalone_mode=False)
        sys.stdout.flush()  # here, where a full disk can still be reported
    except BrokenPipeError:
        _discard_output()
        return 0  # `wheelwire monitor | head` is not an error
    except WheelwireError:
        raise  # some are OSErrors, too: of a robot, not of the output
    except OSError as error:
        if error.errno not in _FULL:
            raise
        _discard_output()
        raise OutputFailed(
            f"cannot write the output: {error.strerror}; free some space, or write it elsewhere"
        ) from error
    return code if isinstance(code, int) else 0


def _usage(error: Exception) -> str:
    """What is wrong, and which help explains it. `error` is a UsageError of either Click."""
    message = " ".join(str(error.format_message()).split()).rstrip(".")  # type: ignore[attr-defined]
    context = getattr(error, "ctx", None)
    path = context.command_path if context else "wheelwire"
    return f"{message}; see `{path} --help`"


def _discard_output() -> None:
    """Redirect stdout: flushing the rest of its buffer at exit would fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
