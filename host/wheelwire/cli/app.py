"""The application with all commands, and its exit codes.

0 done; 2 wrong usage; 130 interrupted; else the error's `exit_code`, see `wheelwire.errors`.
"""

from __future__ import annotations

import errno
import io
import logging
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from wheelwire import __version__
from wheelwire.arguments import at_home
from wheelwire.errors import DeviceRefused, OutputFailed, WheelwireError, with_point
from wheelwire.link.ports import UNIX
from wheelwire_protocol.codes import RefusalCode

from . import INTERRUPTED
from .help import lead_to_pages, more_about
from .interruptions import Interrupted
from .output import UsageError, print_error, print_interruption, show_help_alone
from .registry import Commands, commands

USAGE = 2
_LATCHED = (RefusalCode.ESTOPPED, RefusalCode.FAULT)
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def application(word: str = "") -> typer.Typer:
    """The application with all commands, or only with the one that `word` names."""
    app = Commands(
        name="wheelwire",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(invoke_without_command=True)(wheelwire)
    added = commands(word)
    for command in added:
        if isinstance(command.runs, typer.Typer):
            app.add_typer(command.runs, name=command.name, rich_help_panel=command.heading.value)
        else:
            add = app.command(
                command.name, has_json=command.has_json, rich_help_panel=command.heading.value
            )
            add(command.runs)
    lead_to_pages(app, {command.name: command.page for command in added})
    return app


def wheelwire(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """Drive, watch and set up a Wheelwire robot."""
    if version:
        typer.echo(f"wheelwire {__version__}")
        raise typer.Exit
    show_help_alone(context)


def run() -> int:
    """Run the command line; returns its exit code."""
    _open_closed_streams()
    # An error of the command says what a log line of the link would say, and what to do.
    for name in ("wheelwire.link", "wheelwire.sensors"):
        logging.getLogger(name).addHandler(logging.NullHandler())
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # print ? on an ASCII terminal, do not fail
    return _result()


def _at_home(word: str) -> str:
    """A path that begins with `~`, which a shell leaves alone in `--output=~/x` and in quotes."""
    option, equals, value = word.partition("=") if word.startswith("--") else ("", "", word)
    scheme = UNIX if value.startswith(UNIX) else ""
    path = value.removeprefix(scheme)
    if path != "~" and not path.startswith("~/"):
        return word
    return f"{option}{equals}{scheme}{at_home(Path(path))}"


def _open_closed_streams() -> None:
    """A stream that the caller has closed reads and writes nothing, as /dev/null does."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115 - stays open


def _result() -> int:
    try:
        return _run_app(sys.argv[1:])
    except WheelwireError as error:
        kind = type(error).__name__
        print_error(_message(error), kind, error.exit_code, more_about(kind))
        return error.exit_code
    except UsageError as error:
        print_error(_usage(error), "UsageError", USAGE)
        return USAGE
    except Interrupted as ended:
        print_interruption(str(ended), ended.exit_code)
        return ended.exit_code
    except (KeyboardInterrupt, typer.Abort):
        print_interruption("interrupted", INTERRUPTED)
        return INTERRUPTED


def _run_app(arguments: list[str]) -> int:
    try:
        # Not standalone: then Click would print errors in its own form, and exit.
        words = [_at_home(word) for word in arguments]
        app = application(*words[:1])
        code = app(words, prog_name="wheelwire", standalone_mode=False)
        if code == INTERRUPTED:  # Typer has made an exit of the interrupt, and said nothing
            raise KeyboardInterrupt
        sys.stdout.flush()  # here, where a full disk can still be reported
    except (BrokenPipeError, SystemExit) as ended:
        # Within a command Typer has made an exit of it.
        if isinstance(ended, SystemExit) and not isinstance(ended.__context__, BrokenPipeError):
            raise
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


def _message(error: WheelwireError) -> str:
    """What the error says, and for a latched robot the command that ends it."""
    text = str(error)
    latched = isinstance(error, DeviceRefused) and error.code in _LATCHED
    if latched and "wheelwire clear" not in text:
        return f"{text} `wheelwire clear` with the same ROBOT ends it"
    return text


def _usage(error: Exception) -> str:
    """The message of wrong usage, and the help to read. `error` is either Click's UsageError."""
    message = " ".join(str(error.format_message()).split()).rstrip(".")  # type: ignore[attr-defined]
    context = getattr(error, "ctx", None)
    path = context.command_path if context else "wheelwire"
    hint = next((hint for wrong, hint in _MEANT.get(path, ()) if wrong in message), "")
    if "valid number" in message or "valid float" in message or "valid integer" in message:
        hint = next(filter(None, map(with_point, sys.argv)), hint)
    return f"{message}{hint}; see `{path} --help`"


_MEANT = {
    "wheelwire drive": [
        (f"No such option: {name}", ": a velocity is --linear (m/s), --angular (rad/s) or both")
        for name in ("--speed", "--velocity", "--distance", "--turn")
    ],
    "wheelwire flash": [("unexpected extra argument", ": an image is given by --image")],
}
"""Options that people give to a command without such an option, and what they mean."""


def _discard_output() -> None:
    """Redirect stdout: flushing the rest of its buffer at exit would fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
