"""`python -m wheelwire.pi SETTINGS`: the core and its guard, started as one process.

SETTINGS is the JSON of `McuSettings`. The first line on a connected socket is the result of the
start, in JSON; after it the socket carries the protocol.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import time
import traceback
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ConfigurationError, LinkLost, WheelwireError
from . import guard
from .gpio import import_library
from .guard import Heartbeat, Phase
from .settings import McuSettings

if TYPE_CHECKING:
    from wheelwire_protocol.core import Sensors

GUARD_START_S = 10.0
_PARENT_ENDED = "wheelwire: the application ended before its pins were opened"
FAILED = 1


def main() -> int:
    """Fork: the child is the core, this process its guard. Returns the exit status."""
    settings = McuSettings.from_json(sys.argv[1])
    # A terminal sends Ctrl-C to all its processes. The application handles it: it stops the robot,
    # then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Before the fork: the application is the parent of this process, not of the core.
    parent = _pidfd_of_parent(settings.parent)
    import_library(settings)
    heartbeat = Heartbeat()
    guard_pid = os.getpid()
    core_pid = os.fork()
    if core_pid == 0:
        status = FAILED
        try:
            # The core also ends if its guard dies: it must never drive unguarded.
            status = _run_core(settings, heartbeat, [parent, os.pidfd_open(guard_pid)])
        except BaseException:
            traceback.print_exc()
        os._exit(status)  # not sys.exit: the exit handlers belong to the guard
    return _run_guard(settings, heartbeat, core_pid)


def _run_guard(settings: McuSettings, heartbeat: Heartbeat, core_pid: int) -> int:
    from .gpio import prepare_enable_low

    endings = [signal.SIGTERM, signal.SIGHUP]
    if settings.listen is not None:
        endings.append(signal.SIGINT)  # a service has no application that handles it
    # Passed on: the core brakes and releases its pins, and this process ends with it.
    for ending in endings:
        signal.signal(ending, lambda *_: os.kill(core_pid, signal.SIGTERM))
    if settings.socket is not None:
        # Only the core may hold the socket: the application must see it close when the core ends.
        os.close(settings.socket)
    # What is refused is the core's to report: it asks for the same.
    guard.request_realtime(guard.GUARD_PRIORITY)
    prepare = partial(prepare_enable_low, settings)
    return guard.watch(core_pid, heartbeat, settings.core_timeout_ms / 1000, prepare)


def _run_core(settings: McuSettings, heartbeat: Heartbeat, endings: list[int | None]) -> int:
    """Run the core, and the processes that read its buses."""
    from wheelwire_protocol.core import Sensors
    from wheelwire_protocol.native import NativeMissingError

    from .core import check_board
    from .i2c import BusReaders

    start_ns = time.monotonic_ns()
    # Before there are pins: a reader that does not end must not hold any.
    try:
        check_board(settings)  # or a bus that a pin of the list excludes would be what is reported
        sensors = Sensors(settings.board.packed())
        readers = BusReaders(sensors, settings.buses, start_ns)
    except (WheelwireError, NativeMissingError, OSError) as error:
        return _fail(settings, error)
    with closing(readers):
        return _run_on_pins(settings, heartbeat, endings, sensors, start_ns)


def _run_on_pins(
    settings: McuSettings,
    heartbeat: Heartbeat,
    endings: list[int | None],
    sensors: Sensors,
    start_ns: int,
) -> int:
    """Run the core. However it ends, the wheels coast and the pins are released."""
    from wheelwire_protocol.native import NativeMissingError

    from .core import McuLoop, active_parameters, make_core
    from .gpio import open_gpio
    from .line import ConnectedLine, Line, ListeningLine
    from .storage import keep_recorder

    # First: from here on a signal ends the loop, with the wheels stopped, and not the process.
    end_signal = _open_end_signal()
    limit = guard.request_realtime(
        guard.CORE_PRIORITY
    )  # before the pin library starts threads, which inherit it
    try:
        gpio = open_gpio(settings, active_parameters(settings))
    except (WheelwireError, NativeMissingError, OSError) as error:
        return _fail(settings, error)
    started = False
    try:
        core = make_core(settings, heartbeat, sensors)
        keep_recorder(core, settings, heartbeat)
        limits = (*gpio.limits, *([limit] if limit else []))
        # Before anybody hears that the robot is ready: nothing may drive unguarded.
        _await_guard(heartbeat)
        line: Line
        if settings.socket is not None:
            _send_answer(settings.socket, {"limits": limits})
            line = ConnectedLine(settings.socket)
        else:
            line = ListeningLine(Path(settings.listen or ""))
            sys.stdout.write(f"wheelwire: ready at unix:{settings.listen}\n")
            sys.stdout.flush()
        started = True
        # Only now: opening the pins may take longer than a running core may be silent.
        heartbeat.phase = Phase.RUNNING
        ends = [end_signal, *(fd for fd in endings if fd is not None)]
        McuLoop(core, gpio, line, heartbeat, ends, start_ns).run()
    except LinkLost as error:
        return _print_error(error)
    except (WheelwireError, OSError) as error:
        # Once the application knows that all is well, the socket carries frames.
        return _print_error(error) if started else _fail(settings, error)
    finally:
        # In this order: if closing hangs or dies, the guard still pulls EN low.
        gpio.close()
        heartbeat.phase = Phase.CLOSED
    return 0


def _pidfd_of_parent(pid: int | None) -> int | None:
    """Becomes readable when the application ends, even if a fork of it holds the socket open."""
    if pid is None:
        return None
    try:
        parent = os.pidfd_open(pid)
    except ProcessLookupError:
        sys.exit(_PARENT_ENDED)
    if os.getppid() != pid:  # it ended before the pidfd was opened, which may be another's now
        sys.exit(_PARENT_ENDED)
    return parent


def _open_end_signal() -> int:
    """A descriptor that becomes readable on SIGTERM or SIGHUP."""
    # Not a flag: after a signal, `select` goes on waiting (PEP 475), so nothing would check it.
    receiver, sender = socket.socketpair()
    receiver.setblocking(False)
    sender.setblocking(False)

    def on_signal(*_: object) -> None:
        with suppress(BlockingIOError):  # full: it is readable already
            sender.send(b"\0")

    for ending in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, on_signal)
    # Detached, or the end of this function would close it. The handler keeps the other end.
    return receiver.detach()


def _await_guard(heartbeat: Heartbeat) -> None:
    end = time.monotonic() + GUARD_START_S
    while not heartbeat.guarded:
        if time.monotonic() > end:
            raise ConfigurationError(
                "the process that guards the pins did not start: its message is on standard error"
            )
        time.sleep(0.001)


def _fail(settings: McuSettings, error: Exception) -> int:
    if settings.socket is None:
        return _print_error(error)
    _send_answer(settings.socket, {"error": type(error).__name__, "text": str(error)})
    return FAILED


def _print_error(error: Exception) -> int:
    sys.stderr.write(f"wheelwire: {error}\n")
    return FAILED


def _send_answer(fd: int, answer: dict[str, object]) -> None:
    with suppress(BrokenPipeError):  # the application has ended
        os.write(fd, (json.dumps(answer) + "\n").encode())


if __name__ == "__main__":
    sys.exit(main())
