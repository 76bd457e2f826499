"""The link to a robot: one session over one port, served by one thread.

session.py      hello, dispatch; no I/O in this, requests, setpoints and clock;
                preparation.py: what is asked before a session is open; device_reports.py: what the
                device has reported; handover.py: a copy that goes on
requests.py     what is answered: repeats, time-outs, trials; setpoints.py: what expires instead
clock.py        device time to host time, and its error; when to ping, and when a device is silent
sample_stream.py state frames to samples, the newest one, and iterators over all;
                sensor_stream.py: the same of what sensors measure
port_loop.py    the thread that reads and writes; shared_thread.py: one for several ports;
                port_policy.py: baud rates, and opening a port again; threads.py: waiting, forks
device_link.py  what every link offers, in virtual time, too, and how it arms the robot;
                connection.py: `Link`, which hands requests to that thread, and their answers to
                callers
holds.py        what keeps the robot from driving, and what ended its last motion
info.py         the device; statistics.py: the counters, health;
                plain_text.py: what a chip says that does not run
transports.py   a tty, a socket or a child process; ports.py and discovery.py find boards
traffic.py      what crosses the link, for recorder, view and other programs;
                sharing.py: offers it to these, in sharing_folder.py; program_names.py: their names
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from logging import Logger


class LazyLogger:
    """The standard library's logger of a name.

    `logging` takes milliseconds of a program's start, and this library has nothing to say to most
    programs that drive: it is imported with the first words.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def info(self, text: str, *values: object) -> None:
        """As of a logger."""
        if "logging" in sys.modules:  # else nobody has set it up to show less than warnings
            self._logger.info(text, *values, stacklevel=2)

    def warning(self, text: str, *values: object) -> None:
        """As of a logger."""
        self._logger.warning(text, *values, stacklevel=2)

    def exception(self, text: str, *values: object) -> None:
        """As of a logger."""
        self._logger.exception(text, *values, stacklevel=2)

    @property
    def _logger(self) -> Logger:
        from logging import getLogger

        return getLogger(self._name)


LOG = LazyLogger("wheelwire")
LINK_LOG = LazyLogger("wheelwire.link")
"""Logs the loss and the return of a link alone: a program that reports them itself can filter."""
