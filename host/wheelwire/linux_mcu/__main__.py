"""`python -m wheelwire.linux_mcu SETTINGS`: the core and its guard, started as one process.

SETTINGS is the JSON of `McuSettings`. On a connected socket the first line says in JSON how the
start went; from then on it carries the protocol.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import time
import traceback
from contextlib import suppress
from functools import partial
from pathlib import Path

from ..errors import ConfigurationError, LinkLost, WheelwireError
from .heartbeat import Heartbeat, Phase
from .settings import McuSettings

GUARD_START_S = 10.0
FAILED = 1


def main() -> int:
    """Fork: the child is the core, this process its guard. Returns the exit status."""
    settings = McuSettings.from_json(sys.argv[1])
    # Ctrl-C is for the application, which stops the robot and ends this process then.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = _pidfd_of_parent(settings.parent)
    heartbeat = Heartbeat()
    guard_pid = os.getpid()
    core_pid = os.fork()
    if core_pid == 0:
        status = FAILED
        try:
            status = _run_core(settings, heartbeat, [parent, os.pidfd_open(guard_pid)])
        except BaseException:
            traceback.print_exc()
        os._exit(status)
    return _run_guard(settings, heartbeat, core_pid)


def _run_guard(settings: McuSettings, heartbeat: Heartbeat, core_pid: int) -> int:
    from . import guard, realtime
    from .gpio import prepare_enable_low

    for ending in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, lambda *_: os.kill(core_pid, signal.SIGTERM))
    if settings.socket is not None:
        os.close(settings.socket)
    realtime.become_punctual(realtime.GUARD_PRIORITY)
    prepare = partial(prepare_enable_low, settings)
    return guard.watch(core_pid, heartbeat, settings.core_timeout_ms / 1000, prepare)


def _run_core(settings: McuSettings, heartbeat: Heartbeat, endings: list[int | None]) -> int:
    """The core's whole life; whatever ends it, the wheels coast and the pins are given back."""
    from wheelwire_protocol.native import NativeMissingError

    from . import realtime
    from .core import McuLoop, make_core, parameters_in_force
    from .gpio import open_gpio
    from .line import ConnectedLine, Line, ListeningLine

    asked_to_end = _end_signals()
    limit = realtime.become_punctual(realtime.CORE_PRIORITY)  # threads inherit the priority
    try:
        gpio = open_gpio(settings, parameters_in_force(settings))
    except (WheelwireError, NativeMissingError, OSError) as error:
        return _fail(settings, error)
    try:
        limits = (*gpio.limits, *([limit] if limit else []))
        _await_guard(heartbeat)
        line: Line
        if settings.socket is not None:
            _tell(settings.socket, {"limits": limits})
            line = ConnectedLine(settings.socket)
        else:
            line = ListeningLine(Path(settings.listen or ""))
            sys.stdout.write(f"wheelwire: ready at unix:{settings.listen}\n")
            sys.stdout.flush()
        heartbeat.phase = Phase.RUNNING
        ends = [asked_to_end, *(fd for fd in endings if fd is not None)]
        McuLoop(make_core(settings, heartbeat), gpio, line, heartbeat, ends).run()
    except LinkLost as error:
        return _complain(error)
    except (WheelwireError, OSError) as error:
        return _fail(settings, error)
    finally:
        gpio.close()
        heartbeat.phase = Phase.CLOSED
    return 0


def _pidfd_of_parent(pid: int | None) -> int | None:
    """Readable when the application has ended: a fork of it may hold the socket open."""
    if pid is None:
        return None
    parent = os.pidfd_open(pid)
    if os.getppid() != pid:
        sys.exit("the application has ended already")
    return parent


def _end_signals() -> int:
    """A descriptor that becomes readable when this process is told to end."""
    told, tell = socket.socketpair()
    told.setblocking(False)
    tell.setblocking(False)

    def note(*_: object) -> None:
        with suppress(BlockingIOError):
            tell.send(b"\0")

    for ending in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, note)
    return told.detach()


def _await_guard(heartbeat: Heartbeat) -> None:
    end = time.monotonic() + GUARD_START_S
    while not heartbeat.guarded:
        if time.monotonic() > end:
            raise ConfigurationError("the process that guards the pins did not start")
        time.sleep(0.001)


def _fail(settings: McuSettings, error: Exception) -> int:
    if settings.socket is None:
        return _complain(error)
    _tell(settings.socket, {"error": type(error).__name__, "text": str(error)})
    return FAILED


def _complain(error: Exception) -> int:
    sys.stderr.write(f"wheelwire: {error}\n")
    return FAILED


def _tell(fd: int, answer: dict[str, object]) -> None:
    with suppress(BrokenPipeError):  # the application has gone meanwhile
        os.write(fd, (json.dumps(answer) + "\n").encode())


if __name__ == "__main__":
    sys.exit(main())
