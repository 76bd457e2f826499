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
from wheelwire.link.statistics import quantile
from wheelwire.simulation.simulator import Simulator

from .bare_host import PING_SIZE, PONG_SIZE, BareHost, echo_process

ANY_BAUD = 921_600
"""Any baud rate will do: the line has none."""
BAUDS = (115_200, 921_600)
ROUNDS = 6
EXCHANGES = 200
PAUSE_S = 0.001
"""Pause between exchanges, so that caches are cold again."""
BITS_PER_BYTE = 10

ECHO, FIRMWARE = "echo in C, bare host", "firmware, bare host"
PING, REQUEST = "firmware, library's ping", "firmware, library's request"

K = TypeVar("K")
Quantiles: TypeAlias = tuple[float, float]
"""The median, and what one in a hundred exceeds, in microseconds."""


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
                ECHO: lambda: _exchanges(echo.echo),
                FIRMWARE: lambda: _exchanges(firmware.ping),
                PING: lambda: _pings(robot),
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
        hosts = {baud: _bare_host(stack, baud) for baud in BAUDS}
        return _in_rounds({baud: partial(_exchanges, hosts[baud].ping) for baud in BAUDS})


def line_us(baud: int) -> float:
    """Time that a ping and its answer take on the line."""
    return 1e6 * (PING_SIZE + PONG_SIZE) * BITS_PER_BYTE / baud


def _bare_host(stack: ExitStack, baud: int) -> BareHost:
    port = stack.enter_context(Simulator(baud_rate=baud)).port
    host = stack.enter_context(closing(BareHost(port, baud)))
    host.open_session(stream_rate_hz=0)
    return host


def _in_rounds(measures: Mapping[K, Callable[[], Quantiles]]) -> dict[K, RoundTrips]:
    found = {name: RoundTrips([], []) for name in measures}
    for _ in range(ROUNDS):
        for name, measure in measures.items():
            p50_us, p99_us = measure()
            found[name].p50s_us.append(p50_us)
            found[name].p99s_us.append(p99_us)
    return found


def _exchanges(exchange: Callable[[], float]) -> Quantiles:
    times = []
    for _ in range(EXCHANGES):
        time.sleep(PAUSE_S)
        times.append(exchange())
    return 1e6 * quantile(times, 0.50), 1e6 * quantile(times, 0.99)


def _pings(robot: SerialDriver) -> Quantiles:
    """The library's round trips, with more frequent pings; its statistics cover the last 1024."""
    with mock.patch.object(synchroniser, "PERIOD_US", round(PAUSE_S * 1e6)):
        time.sleep(EXCHANGES * PAUSE_S)
    found = robot.statistics
    return found.round_trip_p50_us, found.round_trip_p99_us


def _seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin
