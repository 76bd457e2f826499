"""Round trips over pseudo-terminals: an echo, the firmware's core, and all of Wheelwire."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple, TypeAlias, TypeVar
from unittest import mock

from wheelwire.drivers.serial import SerialDriver
from wheelwire.link import clock as synchroniser
from wheelwire.link import info
from wheelwire.link.statistics import quantile
from wheelwire.simulation.simulator import Simulator

from .bare_host import PING_SIZE, PONG_SIZE, BareHost, echo_process

ANY_BAUD = 921_600
"""Any baud rate will do: the line has none."""
BAUDS = (115_200, 921_600)
ROUNDS = 6
TURNS = 10
EXCHANGES = 20
"""In a turn. Short turns, for what a computer does with a core changes within a second."""
PAUSE_S = 0.001
"""Pause between exchanges, so that caches are cold again."""
BITS_PER_BYTE = 10

ECHO, FIRMWARE = "echo in C, bare host", "firmware, bare host"
PING, REQUEST = "firmware, library's ping", "firmware, library's request"

K = TypeVar("K")
Measure: TypeAlias = Callable[[], list[float]]
"""The round trips of one turn. [us]"""


class RoundTrips(NamedTuple):
    """Round trips of one kind, in microseconds, by round."""

    p50s_us: list[float]
    p99s_us: list[float]

    @property
    def p50_us(self) -> float:
        """The median round's."""
        return median(self.p50s_us)

    @property
    def p99_us(self) -> float:
        """The median round's."""
        return median(self.p99s_us)


def compare(folder: Path) -> dict[str, RoundTrips]:
    """The echo, the firmware with a bare host, the firmware with the library; interleaved."""
    with ExitStack() as stack:
        echo_port = stack.enter_context(echo_process(folder))
        echo = stack.enter_context(closing(BareHost(echo_port, ANY_BAUD)))
        simulator = stack.enter_context(Simulator())
        firmware = stack.enter_context(closing(BareHost(simulator.port, ANY_BAUD)))
        firmware.open_session(stream_rate_hz=0)
        port = stack.enter_context(Simulator()).port
        robot = stack.enter_context(open_without_stream(port))
        return _in_rounds(
            {
                ECHO: lambda: _exchanges(lambda: echo.exchange(PING_SIZE)),
                FIRMWARE: lambda: _exchanges(firmware.exchange),
                PING: _pings,
                REQUEST: lambda: _exchanges(lambda: _seconds(robot.device_counters)),
            }
        )


def open_without_stream(port: str) -> SerialDriver:
    """A link on which only answers come."""
    with SerialDriver(port) as robot:
        robot.parameters.set("stream_rate_hz", 0)
    return SerialDriver(port)


def on_slow_lines() -> dict[int, RoundTrips]:
    """The firmware with a bare host, by baud rate."""
    with ExitStack() as stack:
        measures = {}
        for baud in BAUDS:
            port = stack.enter_context(Simulator(baud_rate=baud)).port
            host = stack.enter_context(closing(BareHost(port, baud)))
            host.open_session(stream_rate_hz=0)
            measures[baud] = partial(_exchanges, host.exchange)
        return _in_rounds(measures)


def line_us(baud: int) -> float:
    """Time that a ping and its answer take on the line."""
    return 1e6 * (PING_SIZE + PONG_SIZE) * BITS_PER_BYTE / baud


def _in_rounds(measures: Mapping[K, Measure]) -> dict[K, RoundTrips]:
    found = {name: RoundTrips([], []) for name in measures}
    for _ in range(ROUNDS):
        times_us: dict[K, list[float]] = {name: [] for name in measures}
        for _ in range(TURNS):
            for name, measure in measures.items():
                times_us[name] += measure()
        for name, taken_us in times_us.items():
            found[name].p50s_us.append(quantile(taken_us, 0.50))
            found[name].p99s_us.append(quantile(taken_us, 0.99))
    return found


def _exchanges(exchange: Callable[[], float]) -> list[float]:
    times_us = []
    for _ in range(EXCHANGES):
        time.sleep(PAUSE_S)
        times_us.append(1e6 * exchange())
    return times_us


def _pings() -> list[float]:
    """The library's round trips, with more frequent pings.

    Of those alone: what it sends between the turns, ten a second, finds colder caches than any
    exchange of the other measures.
    """
    times_us: list[float] = []
    due_s = synchroniser.PERIOD_US / 1e6
    with (
        mock.patch.object(info.RoundTrips, "add", lambda _, taken_us: times_us.append(taken_us)),
        mock.patch.object(synchroniser, "PERIOD_US", round(PAUSE_S * 1e6)),
    ):
        time.sleep(due_s + 2 * EXCHANGES * PAUSE_S)
    # The first has waited for the next one that was due before.
    return times_us[1 : EXCHANGES + 1]


def _seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin
