"""The loop that owns a port, on a port that the test has in hand.

It runs in the test's own thread, which serves the port or has a shared thread serve it.
"""

from __future__ import annotations

import select
import threading
import time
from collections.abc import Callable

import pytest

from support.answering_port import Port
from support.cases import each
from support.core_device import CoreDevice
from wheelwire.errors import (
    LinkClosed,
    LinkLost,
    PortUnavailable,
    RequestTimeout,
    WheelwireError,
)
from wheelwire.link.clock import host_clock_us
from wheelwire.link.port_loop import MAX_FRAME, OUTPUT_LIMIT, PortLoop
from wheelwire.link.port_policy import FIRST_PAUSE_S, IDLE_REST_US
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.session import Phase, Session
from wheelwire.link.shared_thread import SharedThread
from wheelwire.link.threads import Notifier
from wheelwire.link.traffic import Happening, TrafficReader
from wheelwire.link.transports import Transport
from wheelwire_protocol.codes import RefusalCode
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import AnyMessage, Estop, Hello, Refuse, SetDuty, Stop

pytestmark = pytest.mark.timeout(20)

STATE_PERIOD_US = 20_000
"""The device sends a state within it."""


def ignore(_result: object) -> None:
    """For calls whose outcome is of no interest."""


class Rig:
    """A loop on a port.

    Args:
        accepts: Called at each write; False takes no byte.
        device: At the other end of the port.
        lost: Called whenever the port is to be opened again, for the next one.
    """

    served_by: SharedThread | None = None

    def __init__(
        self,
        accepts: Callable[[Rig], object] = lambda _: True,
        device: CoreDevice | None = None,
        lost: Callable[[Rig], Port | None] = lambda _: None,
    ) -> None:
        self.session = Session(lambda: 7)
        self.latest_sample = LatestSample()
        self.port = self.make_port(device, lambda: accepts(self) is not False)
        self.unopened: Port | None = self.port
        self._lost = lost
        self.loop = PortLoop(
            self._open, 0, self.session, Notifier(), self.latest_sample, lambda: True
        )
        self.loop.served_by = self.served_by

    def make_port(self, device: CoreDevice | None, accepts: Callable[[], bool]) -> Port:
        return Port(device, accepts)

    @property
    def is_open(self) -> bool:
        return self.session.phase is Phase.OPEN

    def has_a_current_sample(self) -> bool:
        try:
            self.latest_sample.ticks(0)
        except RequestTimeout:
            return False
        return True

    def ask_for_estop(self) -> None:
        self.loop.call(lambda done, now_us: self.session.stop(None, done, now_us), ignore)

    def _open(self, _baud_rate: int) -> Transport:
        port, self.unopened = self.unopened or self._lost(self), None
        if port is None:
            self.loop.finish()
            raise PortUnavailable("port", "gone")
        return port


@pytest.fixture(autouse=True, params=["alone", "shared"])
def _serving(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "shared":
        monkeypatch.setattr(Rig, "served_by", SharedThread(passed=lambda: None))


def finish(rig: Rig) -> None:
    rig.loop.finish()


def test_the_robot_is_stopped_before_the_port_is_closed() -> None:
    rig = Rig(finish)
    rig.loop.run()
    assert isinstance(rig.port.messages()[-1], Stop)


def test_a_loop_that_is_finished_before_it_runs_opens_no_port() -> None:
    rig = Rig()
    rig.loop.finish()
    assert isinstance(rig.loop.end, LinkClosed)
    rig.loop.run()
    assert rig.unopened is rig.port
    rig.port.close()


def test_a_stop_that_is_not_acknowledged_does_not_keep_the_loop_for_ever() -> None:
    device = CoreDevice()

    def end_once_open(rig: Rig) -> None:
        if rig.is_open:
            device.mute = True
            rig.loop.finish()

    Rig(end_once_open, device).loop.run()
    assert device.count(Stop) > 1  # repeated, as often as this computer gets to it


class Refusing:
    """A port that accepts nothing for a thousand writes, at each of which an e-stop is asked for.

    Attributes:
        writes: How many there have been.
    """

    writes = 0

    def __call__(self, rig: Rig) -> bool:
        self.writes += 1
        if self.writes <= 1000:
            rig.ask_for_estop()
        else:
            rig.loop.finish()
        return self.writes > 1000


def test_bytes_that_a_port_does_not_take_are_dropped() -> None:
    rig = Rig(Refusing())
    rig.loop.run()
    assert 0 < max(len(data) for data in rig.port.written) <= OUTPUT_LIMIT
    # Only whole frames: a part of one would damage the next frame.
    decoder = Decoder()
    messages = decoder.feed(b"".join(rig.port.written))
    assert any(isinstance(message, Estop) for message in messages)
    counters = decoder.counters
    assert (counters.bad_crc, counters.bad_cobs, counters.wrong_length) == (0, 0, 0)
    assert OUTPUT_LIMIT - max(len(data) for data in rig.port.written) < MAX_FRAME


def test_a_setpoint_that_was_taken_is_written_whatever_is_asked_after_it() -> None:
    refusing = Refusing()

    def accepts(rig: Rig) -> bool:
        if not rig.is_open:
            return True
        if not refusing.writes:
            now_us = host_clock_us()
            rig.loop.check_room()
            expiry_us = now_us + 60_000_000
            frame = rig.session.setpoints.frame(SetDuty, 0.1, 0.1, expiry_us, now_us)
            rig.loop.send(frame, now_us)
        return refusing(rig)

    rig = Rig(accepts, CoreDevice())
    rig.loop.run()
    assert any(isinstance(message, SetDuty) for message in rig.port.messages())


def test_an_unplugged_port_is_opened_again_at_once() -> None:
    second = Port()
    coming = iter([second, None])
    rig = Rig(lost=lambda _: next(coming))
    for port in (rig.port, second):
        port.theirs.close()
    rig.loop.run()
    assert rig.loop.policy.reconnects == 1
    assert len(rig.port.messages()) <= 2  # at once, not after a second of hellos


def test_frames_for_a_lost_port_are_not_sent_to_the_next() -> None:
    asked = False

    def full_once_open_then_lost(rig: Rig) -> bool:
        nonlocal asked
        if not rig.is_open:
            return True
        if asked:
            rig.port.theirs.close()
        else:
            asked = True
            rig.ask_for_estop()
        return False

    def end() -> bool:
        rig.loop.finish()
        return True

    second = Port(accepts=end)
    rig = Rig(full_once_open_then_lost, CoreDevice(), lambda _: second)
    rig.loop.run()
    assert asked
    assert isinstance(second.messages()[0], Hello)
    assert not any(isinstance(message, Estop) for message in second.messages())


def test_while_a_port_is_lost_no_sample_is_current() -> None:
    device = CoreDevice()
    found: list[bool] = []

    def unplug_once_open(rig: Rig) -> bool:
        if rig.is_open and rig.port.theirs.fileno() >= 0:
            device.advance(host_clock_us() + STATE_PERIOD_US)
            rig.port.theirs.sendall(device.take_output())
            rig.port.theirs.close()
        return not rig.is_open

    Rig(unplug_once_open, device, lambda rig: found.append(rig.has_a_current_sample())).loop.run()
    assert found == [False]


def test_while_a_session_is_lost_no_sample_is_current_though_the_port_is_there() -> None:
    device = CoreDevice()
    found: list[bool] = []
    lost = 0

    def forget_the_session_once_open(rig: Rig) -> None:
        nonlocal lost
        if rig.is_open and not lost:
            lost = 1
            device.advance(host_clock_us() + STATE_PERIOD_US)
            device.mute = True
            device.send(Refuse(device.session_id, 0x06, RefusalCode.NO_SESSION, 1))
            rig.port.theirs.sendall(device.take_output())
        elif lost:
            lost += 1
            # At the second hello: the first one is written as the loss is found.
            if lost == 3:
                found.append(rig.has_a_current_sample())
                rig.loop.finish()

    Rig(forget_the_session_once_open, device).loop.run()
    assert found == [False]


def test_calls_do_not_shorten_the_pauses_between_attempts_to_open_the_port() -> None:
    attempts_s: list[float] = []
    over = threading.Event()

    def fail(_rig: Rig) -> None:
        attempts_s.append(time.monotonic())
        if len(attempts_s) < 4:
            raise PortUnavailable("port", "gone")

    def call_all_the_time() -> None:
        while not over.wait(0.001):
            rig.loop.call(lambda done, _now_us: done(None), ignore)

    rig = Rig(lost=fail)
    rig.port.theirs.close()
    thread = threading.Thread(target=call_all_the_time)
    thread.start()
    rig.loop.run()
    over.set()
    thread.join()
    assert attempts_s[-1] - attempts_s[0] > 2.9 * FIRST_PAUSE_S


def broken(_done: object, _now_us: int) -> None:
    raise ValueError("a bug")


def run_with(begin: Callable[[Rig], None]) -> Rig:
    """A loop that does something at its first write, and is finished at a later one."""
    calls = iter([begin])
    rig = Rig(lambda rig: next(calls, finish)(rig), CoreDevice())
    rig.loop.run()
    return rig


def test_what_a_call_raises_reaches_its_caller_and_the_link_goes_on() -> None:
    outcomes: list[object] = []
    rig = run_with(lambda rig: rig.loop.call(broken, outcomes.append))
    assert [type(outcome) for outcome in outcomes] == [WheelwireError]
    assert "a bug" in str(outcomes[0])
    assert rig.loop.end is not None
    assert rig.loop.end.__cause__ is None


def test_what_a_call_raises_that_nobody_awaits_ends_the_link() -> None:
    outcomes: list[object] = []

    def begin(rig: Rig) -> None:
        rig.loop.call(broken, ignore, is_awaited=False)
        rig.loop.call(lambda done, _now_us: done(None), outcomes.append)

    rig = run_with(begin)
    assert outcomes == [rig.loop.end]
    assert "a bug" in str(rig.loop.end)
    with pytest.raises(LinkClosed, match="a bug"):
        rig.latest_sample.ticks(0)


def test_each_caller_learns_of_the_end_though_telling_one_fails() -> None:
    outcomes: list[object] = []

    def fail(_result: object) -> None:
        raise IndexError("a bug")

    rig = Rig()
    for done in (outcomes.append, fail, outcomes.append):
        rig.loop.call(lambda done, _now_us: done(None), done)
    with pytest.raises(IndexError, match="a bug"):
        rig.loop.finish()
    assert outcomes == [rig.loop.end, rig.loop.end]
    with pytest.raises(LinkClosed):
        rig.latest_sample.ticks(0)
    rig.port.close()


class Narrow(Port):
    """Takes as many bytes as there is room for."""

    def __init__(self, device: CoreDevice | None) -> None:
        super().__init__(device)
        self.room = 1 << 30
        self.refusals = 0

    def write(self, data: bytes) -> int:
        taken = data[: self.room]
        self.room -= len(taken)
        if not taken:
            self.refusals += 1
            return 0
        return super().write(taken)


class Blocked(Rig):
    """A loop whose port is blocked once its session is open; then it makes these calls, in order.

    Each one is made in a turn of its own, after the loop has tried to write what waits.
    """

    def __init__(self, *calls: Callable[[Blocked], None]) -> None:
        self.device = CoreDevice()
        super().__init__(device=self.device)
        self.size = 0
        """Bytes of a setpoint's frame."""
        self._left = [*calls, finish]
        self._mark = 0
        self._now_us = 0
        """When the turn began."""

    def make_port(self, device: CoreDevice | None, _accepts: object) -> Port:
        self.narrow = Narrow(device)
        return self.narrow

    def run(self) -> list[AnyMessage]:
        """Until the calls are made; returns what the port took since it was blocked."""
        self.loop.call(self._next, ignore)
        self.loop.run()
        return Decoder().feed(self.taken)

    @property
    def taken(self) -> bytes:
        return b"".join(self.narrow.written[self._mark :])

    @property
    def first_write(self) -> bytes:
        """What the port took at once, as the first since it was blocked."""
        return self.narrow.written[self._mark]

    def _next(self, _done: object, now_us: int) -> None:
        # A busy computer may get to two calls in one turn: the second one then waits for the next.
        is_next_turn, self._now_us = now_us != self._now_us, now_us
        if is_next_turn and self.session.phase is Phase.OPEN:
            if not self._mark:
                self._mark = len(self.narrow.written)
                self.device.mute = True
                self.narrow.room = 0
            self._left.pop(0)(self)
        if self._left:
            # Through another thread, so that the turn ends, and writes, before the next call.
            threading.Timer(0.002, self.loop.call, (self._next, ignore)).start()

    def setpoint(self, left: float) -> bytes:
        now_us = host_clock_us()
        return self.session.setpoints.frame(SetDuty, left, 0.0, now_us + 60_000_000, now_us)

    def send(self, left: float) -> None:
        frame = self.setpoint(left)
        self.size = len(frame)
        self.loop.send(frame, host_clock_us())

    def estop(self) -> None:
        self.session.stop(None, ignore, self._now_us)  # as calls do: it is sent in this turn


def opened(room: int) -> Callable[[Blocked], None]:
    def open_up(rig: Blocked) -> None:
        rig.narrow.room = room

    return open_up


WIDE = 1 << 30


def a_turn(_rig: Blocked) -> None:
    """One more, in which the loop writes what waits."""


def place_of(messages: list[AnyMessage], kind: type[AnyMessage]) -> int:
    return next(place for place, message in enumerate(messages) if isinstance(message, kind))


@pytest.mark.parametrize("part", [0, 5])
def test_a_new_setpoint_neither_overtakes_nor_splits_what_waits(part: int) -> None:
    """The port takes a part of an e-stop, and has room again when a setpoint is given."""

    def drive(rig: Blocked) -> None:
        rig.narrow.room = WIDE
        rig.send(0.1)

    def estop(rig: Blocked) -> None:
        rig.narrow.room = part
        rig.estop()

    messages = Blocked(estop, drive).run()
    # Split by another frame, the first e-stop would be lost: the one found would be a repeat.
    assert isinstance(messages[0], Estop)
    assert place_of(messages, Estop) < place_of(messages, SetDuty)


@pytest.mark.parametrize("part", [0, 5])
def test_setpoints_that_wait_are_written_in_their_order(part: int) -> None:
    def drive(rig: Blocked) -> None:
        rig.narrow.room = part
        rig.send(0.1)
        rig.narrow.room = WIDE
        for left in (0.2, 0.3):
            rig.send(left)

    messages = Blocked(drive).run()
    numbers = [message.command_seq for message in messages if isinstance(message, SetDuty)]
    assert numbers == sorted(numbers)
    assert len(set(numbers)) == 3  # the loop may repeat the last one


def test_setpoints_that_wait_are_written_all_at_once() -> None:
    """So the newest one is not late by one pass of the loop for each that waited before it."""

    def drive(rig: Blocked) -> None:
        for left in (0.1, 0.2, 0.3):
            rig.send(left)
        rig.narrow.room = WIDE

    rig = Blocked(drive)
    rig.run()
    first = Decoder().feed(rig.first_write)
    assert [isinstance(message, SetDuty) for message in first] == [True] * 3


def test_a_setpoint_that_has_to_wait_wakes_the_loop() -> None:
    """It waits for the port's data alone, and only from its next turn on for room."""
    woken: list[bool] = []

    def look(rig: Blocked) -> None:
        rig.loop.wake_up.drain()
        rig.send(0.1)
        woken.append(bool(select.select([rig.loop.wake_up], [], [], 0)[0]))

    Blocked(look).run()
    assert woken == [True]


ANSWERS_MS = (4, 3, 2, 1)


@each(
    ("stream", "states_ms", "answers_ms", "wakes"),
    [
        ("100 Hz", (21, 11, 1), (), False),
        ("10 Hz", (201, 101, 1), (), True),
        ("10 Hz and an answer", (206, 106, 6), (1,), True),
        ("10 Hz and answers", (206, 106, 6), ANSWERS_MS, True),
        ("10 Hz, before the next", (230, 130, 30), ANSWERS_MS, True),
        ("100 Hz and answers", (26, 16, 6), ANSWERS_MS, False),
        ("100 Hz, one lost", (45, 35, 25), ANSWERS_MS, False),
        ("ended", (245, 235, 225), ANSWERS_MS, True),
        ("none", (), ANSWERS_MS, True),
    ],
)
def test_a_setpoint_wakes_the_loop_if_no_state_will_before_its_repeat(
    stream: str, states_ms: tuple[int, ...], answers_ms: tuple[int, ...], wakes: bool
) -> None:
    """`states_ms`, `answers_ms`: how long before it they came."""
    rig = Rig()
    loop, now_us = rig.loop, host_clock_us()
    loop._transport, loop._turned_us = rig.port, now_us - 1000
    for frames, read_ms in enumerate(states_ms + answers_ms):
        has_state = frames < len(states_ms)
        loop._coalescing.note_read(frames, now_us - 1000 * read_ms, has_state=has_state)
    loop.send(b"\0", now_us)
    assert bool(select.select([loop.wake_up], [], [], 0)[0]) is wakes, stream
    loop.finish()
    rig.port.close()


def test_a_port_rests_longest_where_nobody_reads_or_listens_and_nothing_drives() -> None:
    rig = Rig()
    loop, now_us = rig.loop, host_clock_us()
    loop._work_pending, loop._due_us = False, now_us + 1_000_000
    for frames, read_us in enumerate((now_us - 10_000, now_us)):
        loop._coalescing.note_read(frames, read_us)

    def rest_us() -> int:
        until_us = loop.next_wait(now_us) - now_us
        return 0 if loop.wanted & select.POLLIN else until_us

    assert rest_us() == IDLE_REST_US
    rig.session.setpoints.moves_until_us = now_us + 1
    assert rest_us() == 0
    rig.session.setpoints.moves_until_us = 0
    rig.loop.listen(ignore, Happening.LOST)
    assert rest_us() == 0
    loop._listener = None
    rig.session.traffic.readers = (TrafficReader(),)
    assert rest_us() == 0
    rig.session.traffic.readers = ()
    rig.latest_sample.poll()
    assert rest_us() == 0
    loop.finish()
    rig.port.close()


def test_a_setpoint_waits_behind_the_stop_that_came_before_it() -> None:
    """A blocked port: the stop is asked for, then another thread of the program drives on."""
    messages = Blocked(
        lambda rig: rig.estop(), lambda rig: rig.send(0.1), opened(WIDE), a_turn
    ).run()
    assert place_of(messages, Estop) < place_of(messages, SetDuty)


def fill(rig: Blocked) -> int:
    """Give setpoints until one is refused; returns how many were taken."""
    for taken in range(1000):
        try:
            rig.loop.check_room()
        except LinkLost:
            return taken
        rig.send(0.1)
    raise AssertionError("the setpoints pile up")


def test_before_a_blocked_port_so_many_setpoints_wait_and_a_stop_still_finds_room() -> None:
    taken: list[int] = []
    rig = Blocked(
        lambda rig: taken.append(fill(rig)),
        lambda rig: taken.append(fill(rig)),  # the loop has moved them to its output
        lambda rig: rig.estop(),
        opened(WIDE),
        a_turn,
    )
    messages = rig.run()
    place = place_of(messages, Estop)
    # By their numbers: the loop repeats the newest one.
    ahead = {message.command_seq for message in messages[:place] if isinstance(message, SetDuty)}
    assert len(ahead) == sum(taken) > 10
    # By hand: half of 4096 bytes.
    assert len(ahead) * rig.size <= 2048 + rig.size


def test_behind_requests_that_wait_no_setpoint_is_taken() -> None:
    def ask(rig: Blocked) -> None:
        for _ in range(200):
            rig.estop()

    taken: list[int] = []
    Blocked(ask, lambda rig: taken.append(fill(rig))).run()
    assert taken == [0]


@pytest.mark.parametrize("part", [1, 7, 20])
def test_a_frame_taken_in_parts_arrives_whole_and_once(part: int) -> None:
    rig = Blocked(lambda rig: rig.estop(), *[opened(part)] * 20, opened(WIDE), a_turn)
    messages = rig.run()
    estops = [message for message in messages if isinstance(message, Estop)]
    assert isinstance(messages[0], Estop)
    # Repeats are whole frames too: nothing of the line is lost between them.
    decoder = Decoder()
    decoder.feed(rig.taken)
    assert (decoder.counters.bad_crc, decoder.counters.bad_cobs) == (0, 0)
    assert len(estops) >= 1
    assert decoder.counters.frames == len(messages)


def test_while_a_stop_waits_the_loop_waits_for_room_and_not_longer() -> None:
    """So it goes out as soon as the port takes bytes again, not with the next repeat."""
    found: dict[str, bool] = {}

    def look(name: str) -> Callable[[Blocked], None]:
        def note(rig: Blocked) -> None:
            found[name] = bool(rig.loop.wanted & select.POLLOUT)

        return note

    # Answers are missing, so a repeat may come in between: each look follows a turn of its own.
    Blocked(
        look("before"), lambda rig: rig.estop(), a_turn, look("waiting"), opened(WIDE), a_turn,
        a_turn, look("after"),
    ).run()  # fmt: skip
    assert found == {"before": False, "waiting": True, "after": False}
