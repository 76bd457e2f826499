"""One thread for the ports of several links: each is served, lost and ended as if it were alone."""

from __future__ import annotations

import errno
import gc
import os
import select
import socket
import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import pytest

from support.answering_port import Port
from support.core_device import CoreDevice
from support.forking import forked
from support.processes import open_files, opened_since
from support.waiting import wait_until
from wheelwire.errors import DriverUnavailable, LinkClosed, LinkLost, WheelwireError
from wheelwire.link.connection import Link, LinkOptions
from wheelwire.link.port_loop import Done
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.shared_thread import SharedThread, _Ports
from wheelwire.link.threads import WakeUp
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
        self.failure: WheelwireError | None = None
        """Why the port cannot be opened."""
        self.may_open = threading.Event()
        self.may_open.set()
        self.latest_sample = LatestSample()
        options = LinkOptions("robot", open_port=self._open, connect_timeout_s=connect_timeout_s)
        self.link = Link(options, self.latest_sample)
        self.link.serve_by(thread)

    def _open(self, _baud_rate: int) -> Transport:
        self.openings += 1
        assert self.may_open.wait(30)
        if self.failure is not None:
            raise self.failure
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


def test_any_failure_to_reopen_is_reported_and_retried(robots: Robots) -> None:
    lost, _ = robots
    lost.failure = DriverUnavailable("pigpiod does not run")
    lost.unplug()
    wait_until(lambda: lost.openings >= 4)
    with pytest.raises(LinkLost, match="pigpiod does not run; trying again"):
        lost.link.check()
    lost.failure = None
    wait_until(lost.is_back)
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


class File(Port):
    """A port whose descriptor leads to a file, which cannot be polled."""

    def __init__(self, device: CoreDevice) -> None:
        super().__init__(device)
        self._file = os.open(__file__, os.O_RDONLY)

    def fileno(self) -> int:
        return self._file

    def close(self) -> None:
        os.close(self._file)
        super().close()


def test_a_port_that_cannot_be_polled_ends_its_own_link_alone(
    thread: SharedThread, robots: Robots
) -> None:
    third = Robot(thread)
    third.link._loop._open_port = lambda _baud_rate: File(third.device)
    with pytest.raises(LinkClosed, match="Operation not permitted"):
        third.link.open()
    assert all(robot.works() for robot in robots)
    assert all(robot.link.sessions == 1 for robot in robots)


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


class Quiet:
    """A port that reads what comes, and has nothing to do otherwise."""

    wanted = select.POLLIN

    def __init__(self, done: Callable[[str], object]) -> None:
        self.ours, self.theirs = socket.socketpair()
        self.wake_up = WakeUp()
        self.fileno = self.ours.fileno
        self._done = done
        self._finished = False

    def turn(self, _transport: object, events: int) -> None:
        if events:
            self._done("turn")
            self._finished = self.ours.recv(1) == b"e"

    def is_over(self) -> bool:
        return self._finished

    def next_wait(self, now_us: int) -> int:
        return now_us + 10_000_000

    def wake_readers(self) -> None:
        self._done("readers")

    def close(self) -> None:
        for end in (self.ours, self.theirs, self.wake_up):
            end.close()


def test_a_waiter_is_woken_once_for_all_ready_ports() -> None:
    happened: list[str] = []
    begun, go_on = threading.Event(), threading.Event()

    def passed() -> None:
        happened.append("passed")
        if not begun.is_set():
            begun.set()
            assert go_on.wait(30)

    thread = SharedThread(passed=passed)
    ports = [Quiet(happened.append) for _ in range(3)]
    serving = [threading.Thread(target=thread.serve, args=(port, port)) for port in ports]
    for one in serving:
        one.start()
    assert begun.wait(30)
    wait_until(
        lambda: thread._ports and len(thread._ports._due_us) + len(thread._ports._joining) == 3
    )
    for port in ports[:2]:
        port.theirs.send(b".")
    happened.clear()
    go_on.set()
    wait_until(lambda: happened[-1:] == ["passed"])
    assert happened == ["turn", "turn", "readers", "readers", "passed"]
    for port in ports:
        port.theirs.send(b"e")
    for one in serving:
        one.join()
    for port in ports:
        port.close()


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


@pytest.mark.parametrize("step", ["add", "release"])
def test_a_link_that_is_thrown_away_at_the_begin_or_end_of_the_serving_is_not_waited_for(
    thread: SharedThread, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a link's own thread, for which the shared one waits, or in the shared one at its end."""
    monkeypatch.setattr("wheelwire.link.connection.CLOSE_TIMEOUT_S", 45.0)
    first, second = Robot(thread), Robot(thread)
    first.link.open()
    usual = getattr(_Ports, step)

    def throw_away(ports: _Ports, *arguments: object) -> None:
        first.link.close()
        usual(ports, *arguments)

    monkeypatch.setattr(_Ports, step, throw_away)
    if step == "add":
        second.link.open()
        assert second.works()
    first.link.finish()
    wait_until(lambda: first.link.has_ended)
    second.link.close()


def test_in_a_forked_process_another_thread_serves(thread: SharedThread, robots: Robots) -> None:
    def child() -> None:
        robot = Robot(thread)
        robot.link.open()
        assert robot.works()

    with thread._lock, forked(child):
        pass
    assert all(robot.works() for robot in robots)


def test_nothing_refers_to_a_link_that_was_closed(thread: SharedThread) -> None:
    robot = Robot(thread)
    link = weakref.ref(robot.link)
    robot.link.open()
    robot.link.close()
    del robot
    wait_until(lambda: (gc.collect(), link() is None)[1])


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
