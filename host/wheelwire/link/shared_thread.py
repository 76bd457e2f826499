"""One thread that serves the open ports of several links.

With a thread for each port, all of them and the thread that waits for samples would compete for the
interpreter's lock at each sample. Here one thread reads every port that has bytes, and then wakes
all waiting threads at once.

A link's own thread opens and reopens its port, because that may take long. While the port is open,
that thread waits in `serve` and costs nothing.
"""

from __future__ import annotations

import select
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from ..errors import LinkLost
from .clock import host_clock_us
from .threads import WakeUp, abandon_in_child, this_thread

if TYPE_CHECKING:
    from .port_loop import PortLoop
    from .transports import Transport


class SharedThread:
    """Serves ports while there are any; the thread begins with the first and ends with the last.

    Args:
        passed: Called by the thread whenever it has served all ports that had something.
    """

    def __init__(self, passed: Callable[[], None]) -> None:
        self._passed = passed
        self._lock = threading.Lock()
        """Held to begin or end the thread. Never by a thread in which signal handlers run."""
        self._ports: _Ports | None = None
        """What the thread serves, while there is one."""
        abandon_in_child(self)

    def is_current_thread(self) -> bool:
        """Whether the caller is this thread, while it has ports."""
        ports = self._ports
        return ports is not None and ports.ident == threading.get_ident()

    def serve(self, port: PortLoop, transport: Transport) -> None:
        """Have the thread serve an open port until `port.is_over()`; wait until then.

        Raises:
            LinkLost: The port was lost, or no thread can be started at the moment.
        """
        member = _Member(port, transport)
        this_thread.holds_ports_up = True
        try:
            with self._lock:
                if self._ports is None:
                    self._ports = self._begin()
                self._ports.add(member)
        finally:
            this_thread.holds_ports_up = False
        member.ended.acquire()
        if member.error is not None:
            raise member.error

    def abandon(self) -> None:
        """The process was forked: the thread is the parent's."""
        ports, self._ports = self._ports, None
        self._lock = threading.Lock()  # a thread of the parent may hold the other one
        if ports is not None:
            ports.close()

    def _begin(self) -> _Ports:
        abandon_in_child(self)  # also of a child that begins a thread of its own
        ports: _Ports | None = None
        try:
            ports = _Ports()
            threading.Thread(
                target=self._run, args=(ports,), name="wheelwire ports", daemon=True
            ).start()
        except (OSError, RuntimeError) as error:
            if ports is not None:
                ports.close()
            # As any other port that cannot be served: it may be possible a moment later.
            raise LinkLost(
                f"no thread can be started for the port ({error}): close other programs; trying "
                "again"
            ) from error
        return ports

    def _run(self, ports: _Ports) -> None:
        this_thread.holds_ports_up = True
        ports.ident = threading.get_ident()
        try:
            while self._goes_on(ports):
                ports.serve_once()
                self._passed()
        except BaseException as error:
            # A bug of this module. No thread may wait for one that is gone.
            with self._lock:
                self._ports = None
            ports.close()
            ports.fail(error)

    def _goes_on(self, ports: _Ports) -> bool:
        """Add ports that were opened, drop those that ended; False if none is left."""
        ports.take_up()
        with self._lock:
            goes_on = ports.goes_on
            if not goes_on:
                self._ports = None
        if not goes_on:
            ports.close()
        # Last: when the last link is closed, the thread has left nothing open.
        ports.release()
        return goes_on


class _Ports:
    """The ports that one thread serves, which alone may use this, but for `add`."""

    def __init__(self) -> None:
        self.ident = 0
        """The thread."""
        self._members: dict[int, _Member] = {}
        """Members, by the descriptors of the port and of its wake-ups."""
        self._due_us: dict[_Member, int] = {}
        """When each of them has work although nothing comes."""
        self._joining: deque[_Member] = deque()
        self._dismissed: list[_Member] = []
        """Whose own threads are about to go on."""
        # Few of many ports have something: `poll` would look at all of them each time.
        self._epoll = select.epoll()
        self._wake_up = WakeUp()
        self._epoll.register(self._wake_up, select.EPOLLIN)

    def add(self, member: _Member) -> None:
        """Have the thread take a port up; called by the link's own thread."""
        self._joining.append(member)
        self._wake_up.wake()

    @property
    def goes_on(self) -> bool:
        """Whether there is a port to serve."""
        return bool(self._due_us or self._joining)

    def take_up(self) -> None:
        """Begin to serve the ports that were added."""
        while self._joining:
            member = self._joining.popleft()
            self._due_us[member] = 0
            try:
                for descriptor in member.descriptors:
                    self._epoll.register(descriptor, select.EPOLLIN)
                    self._members[descriptor] = member
            except (OSError, ValueError) as error:  # it cannot be polled
                self._dismiss(member, error)
            else:
                self._turn(member, 0)  # earlier calls did not wake this thread

    def serve_once(self) -> None:
        """Wait until a port has something, or is due; serve all that do or are."""
        until_us = min(self._due_us.values(), default=0)
        wait_s = max(0, until_us - host_clock_us()) / 1e6
        turns: dict[_Member, int] = {}
        """The events of each port whose turn it is."""
        for descriptor, events in self._epoll.poll(wait_s, 2 * len(self._due_us) + 1):
            member = self._members.get(descriptor)
            if member is None:
                self._wake_up.drain()
            elif descriptor == member.descriptors[0]:
                turns[member] = events
            else:
                member.port.take_wake_up()
                turns.setdefault(member, 0)
        now_us = host_clock_us()
        if until_us <= now_us:
            for member, due_us in self._due_us.items():
                if due_us <= now_us:
                    turns.setdefault(member, 0)
        for member, events in turns.items():
            self._turn(member, events)
        # After all turns: a thread that is woken competes with this one for the interpreter.
        for member in turns:
            if member in self._due_us:
                member.port.wake_readers()

    def release(self) -> None:
        """Have the own threads of the ports that are served no more go on."""
        while self._dismissed:
            self._dismissed.pop().ended.release()

    def fail(self, error: BaseException) -> None:
        """Stop serving all ports, because of `error`."""
        for member in (*self._due_us, *self._joining):
            member.error = error
            self._dismissed.append(member)
        self.release()

    def close(self) -> None:
        """Let go of the descriptors."""
        self._epoll.close()
        self._wake_up.close()

    def _turn(self, member: _Member, events: int) -> None:
        port = member.port
        try:
            port.turn(member.transport, events)
            if port.is_over():
                self._dismiss(member, None)
                return
            self._due_us[member] = port.next_wait(host_clock_us())
            if port.wanted != member.polled:
                member.polled = port.wanted
                self._poll_anew(member)
        except BaseException as error:  # of this port alone, which its own thread reports
            self._dismiss(member, error)

    def _poll_anew(self, member: _Member) -> None:
        try:
            self._epoll.modify(member.descriptors[0], member.polled)
        except OSError as error:  # somebody else closed the descriptor
            raise member.transport.lost(error) from error

    def _dismiss(self, member: _Member, error: BaseException | None) -> None:
        del self._due_us[member]
        for descriptor in member.descriptors:
            if self._members.get(descriptor) is member:
                del self._members[descriptor]
                with suppress(OSError):  # somebody else closed it
                    self._epoll.unregister(descriptor)
        member.error = error
        self._dismissed.append(member)


class _Member:
    """A port that is served, or is about to be."""

    __slots__ = ("descriptors", "ended", "error", "polled", "port", "transport")

    def __init__(self, port: PortLoop, transport: Transport) -> None:
        self.port = port
        self.transport = transport
        self.descriptors = transport.fileno(), port.wake_up.fileno()
        self.polled = select.EPOLLIN
        """The port's events that are polled for: `poll` and `epoll` have the same numbers."""
        self.error: BaseException | None = None
        self.ended = threading.Lock()
        """Held until it is served no more."""
        self.ended.acquire(blocking=False)
