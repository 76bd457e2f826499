"""Requests that the calling thread writes: which, and what becomes of them."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.port_loop import PortLoop
from wheelwire.link.traffic import Kind, TrafficReader
from wheelwire.simulation.simulator import Simulator

pytestmark = pytest.mark.whole  # each opens a link to a process


@pytest.fixture
def robot() -> Iterator[SerialDriver]:
    with Simulator() as simulator, SerialDriver(simulator.port, tap=False) as robot:
        yield robot


@pytest.fixture
def handed_over(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Which threads have handed something to the link's, from now on."""
    threads: list[str] = []
    call = PortLoop.call

    def note(loop: PortLoop, *task: object) -> None:
        threads.append(threading.current_thread().name)
        call(loop, *task)  # type: ignore[arg-type]

    monkeypatch.setattr(PortLoop, "call", note)
    return threads


def test_a_recorded_request_is_handed_over(robot: SerialDriver, handed_over: list[str]) -> None:
    reader = TrafficReader()
    robot._link.listen_to_traffic(reader)
    handed_over.clear()
    robot.device_counters()
    assert len(handed_over) == 1
    assert Kind.REQUEST in {record.kind for record in reader.take()}


def test_a_request_that_is_lost_is_repeated(
    robot: SerialDriver, handed_over: list[str], lose_own_writes: Callable[[], None]
) -> None:
    lose_own_writes()
    assert robot.device_counters().frames_received > 0
    assert robot.statistics.requests_repeated > 0
    assert not handed_over


def test_threads_that_ask_at_the_same_time_all_get_their_answers(robot: SerialDriver) -> None:
    with ThreadPoolExecutor(8) as pool:
        counted = list(pool.map(lambda _: robot.device_counters().frames_received, range(200)))
    assert min(counted) > 0
