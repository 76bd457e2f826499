"""One thread for the ports of several links: each is served, lost and ended as if it were alone."""

from __future__ import annotations

import errno
import os
import select
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import pytest

from support.answering_port import Port
from support.core_device import CoreDevice
from support.forking import forked
from support.processes import open_files, opened_since
from support.waiting import wait_until
from wheelwire.errors import LinkClosed, LinkLost, WheelwireError
from wheelwire.link.connection import Link, LinkOptions
from wheelwire.link.port_loop import Done
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.shared_thread import SharedThread
from wheelwire.link.transports import Transport
from wheelwire_protocol.types import ControlCountersGet, Stop

pytestmark = pytest.mark.timeout(60)


class Robot:
    """A device that answers, and a link to it that a shared thread serves."""

    def __init__(self, thread: SharedThread, connect_timeout_s: float = 5.0) -> None:
        self.device = CoreDevice(ttl_max_s=5.0)
        self.ports: list[Port] = []
        self.accepts = True
        self.openings = 0
        self.may_open = threading.Event()
        self.may_open.set()
        self.latest_sample = LatestSample()
        options = LinkOptions("robot", open_port=self._open, connect_timeout_s=connect_timeout_s)
        self.link = Link(options, self.latest_sample)
        self.link.serve_by(thread)

    def _open(self, _baud_rate: int) -> Transport:
        self.openings += 1
        assert self.may_open.wait(30)
        self.ports.append(Port(self.device, lambda: self.accepts))
        return self.ports[-1]

    def unplug(self) -> None:
        self.ports[-1].theirs.close()

    def works(self) -> bool:
        """Whether it answers."""
        return self.link.request(ControlCountersGet(0, 0)) is not None

    def is_back(self) -> bool:
        try:
            return self.works()
        except LinkLost:
            return False

    def task(self, call: Callable[[], object]) -> None:
        """Have the thread that serves the port make a call."""

        def task(done: Done, _now_us: int) -> None:
            call()
            done(None)

        self.link._loop.call(task, lambda _: None)


Robots = tuple[Robot, Robot]


@pytest.fixture
def thread() -> SharedThread:
    return SharedThread(passed=lambda: None)


@pytest.fixture
def robots(thread: SharedThread) -> Iterator[Robots]:
    both = Robot(thread), Robot(thread)
    for robot in both:
        robot.link.open()
    yield both
    for robot in both:
        robot.may_open.set()
        robot.link.close()


def serving_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "wheelwire ports"]


def test_one_thread_serves_all(robots: Robots) -> None:
    idents: list[int] = []
    for robot in robots:
        robot.task(lambda: idents.append(threading.get_ident()))
        assert robot.works()
    assert idents == [serving_threads()[0].ident] * 2


def test_a_port_is_lost_and_opened_again_while_the_other_is_served(robots: Robots) -> None:
    lost, other = robots
    lost.may_open.clear()  # opening it takes long
    lost.unplug()
    wait_until(lambda: not lost.is_back())
    for _ in range(20):
        assert other.works()
    assert len(lost.ports) == 1
    lost.may_open.set()
    wait_until(lost.is_back)
    assert other.link.sessions == 1
    assert lost.link.statistics.reconnects == 1


def test_a_failure_ends_its_own_link_alone(
    robots: Robots, caplog: pytest.LogCaptureFixture
) -> None:
    first, second = robots

    def fail() -> None:
        raise SystemExit("a listener that ends its thread")

    first.task(fail)
    wait_until(lambda: first.link.has_ended)
    with pytest.raises(LinkClosed, match="thread failed"):
        first.works()
    assert "failed" in caplog.text
    assert second.works()


def test_a_failure_of_the_thread_itself_ends_every_link(
    thread: SharedThread,
    robots: Robots,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    def fail() -> None:
        raise ZeroDivisionError

    with monkeypatch.context() as patch:
        patch.setattr(thread, "_passed", fail)
        wait_until(lambda: all(robot.link.has_ended for robot in robots))
    assert "ZeroDivisionError" in caplog.text
    again = Robot(thread)
    again.link.open()
    assert again.works()
    again.link.close()


def test_the_thread_ends_with_the_last_port_and_begins_with_the_next(thread: SharedThread) -> None:
    files = open_files()
    for _ in range(3):
        robot = Robot(thread)
        robot.link.open()
        assert robot.works()
        assert len(serving_threads()) == 1
        robot.link.close()
        wait_until(lambda: not serving_threads())
        del robot
        wait_until(lambda: not opened_since(files))


def no_thread(patch: pytest.MonkeyPatch) -> None:
    start = threading.Thread.start

    def refuse(self: threading.Thread) -> None:
        if self.name == "wheelwire ports":
            raise RuntimeError("can't start new thread")
        start(self)

    patch.setattr(threading.Thread, "start", refuse)


def no_descriptor(patch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    patch.setattr(select, "epoll", refuse)


def test_without_a_thread_the_link_does_not_open(
    thread: SharedThread, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = open_files()
    no_thread(monkeypatch)
    robot = Robot(thread, connect_timeout_s=0.2)
    with pytest.raises(WheelwireError, match="can't start new thread"):
        robot.link.open()
    ports = robot.ports
    wait_until(lambda: all(port.fileno() < 0 for port in ports))
    del robot
    wait_until(lambda: not opened_since(files))


@pytest.mark.parametrize("refuse", [no_thread, no_descriptor])
def test_a_lost_port_is_served_again_once_a_thread_can_be_started(
    thread: SharedThread,
    refuse: Callable[[pytest.MonkeyPatch], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = Robot(thread)
    robot.link.open()
    with monkeypatch.context() as patch:
        refuse(patch)
        robot.unplug()
        wait_until(lambda: len(robot.ports) > 3 or robot.link.has_ended)
        assert not robot.link.has_ended
    wait_until(robot.is_back)
    robot.link.close()


def test_a_descriptor_that_somebody_else_closed_ends_no_other_link(robots: Robots) -> None:
    first, second = robots
    first.task(first.ports[-1].ours.close)
    first.accepts = False  # other events than before are to be polled for
    with suppress(LinkLost):  # the thread may have noticed already
        first.link.drive_velocity(0.2, 0.2, first.link.clock_us() + 4_000_000)
    wait_until(lambda: len(first.ports) == 2)
    first.accepts = True
    wait_until(first.is_back)
    first.task(first.ports[-1].ours.close)
    first.link.close()
    assert second.works()
    assert second.link.sessions == 1


def test_a_link_that_the_thread_itself_throws_away_is_not_waited_for(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by the garbage collector, whose finalisers run in whichever thread calls it."""
    monkeypatch.setattr("wheelwire.link.connection.CLOSE_TIMEOUT_S", 45.0)
    first, second = robots
    alone = Robot(SharedThread(passed=lambda: None))
    alone.may_open.clear()  # its link ends once its port is open
    for _ready, _timeout_s in alone.link.opening():
        break
    wait_until(lambda: alone.openings)
    second.task(alone.link.close)
    second.task(first.link.close)
    wait_until(lambda: first.link.has_ended)
    assert second.works()
    assert not alone.link.has_ended
    alone.may_open.set()
    wait_until(lambda: alone.link.has_ended)


def test_in_a_forked_process_another_thread_serves(thread: SharedThread, robots: Robots) -> None:
    def child() -> None:
        robot = Robot(thread)
        robot.link.open()
        assert robot.works()

    with thread._lock, forked(child):
        pass
    assert all(robot.works() for robot in robots)


def test_a_port_that_is_finished_as_it_joins_is_stopped_at_once(
    thread: SharedThread, robots: Robots
) -> None:
    finished = Robot(thread)
    wait = partial(finished.link.changed.wait_for, lambda: finished.link.has_ended, 30)
    opening = finished.link._loop._open_port

    def open_and_finish(baud_rate: int) -> Transport:
        finished.link.finish()
        return opening(baud_rate)

    finished.link._loop._open_port = open_and_finish
    with pytest.raises(LinkClosed):
        finished.link.open()
    assert wait()
    assert any(isinstance(message, Stop) for message in finished.ports[0].messages())
    assert all(robot.works() for robot in robots)
