"""Stops of attached programs: merged among each other, as configured, and of no session."""

from __future__ import annotations

import os
import socket
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from support.attached import holder_of
from support.pty_device import PtyDevice
from support.virtual_line import VirtualLine
from support.waiting import wait_until
from wheelwire.drivers.attached import AttachedDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import LinkLost, WheelwireError
from wheelwire.link import sharing_folder
from wheelwire.link.requests import Answer, Done
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.traffic import STOP_ASKED, Kind, TrafficReader
from wheelwire.log.rerun import Rerun
from wheelwire.log.share.attached_link import AttachedLink, find_holder
from wheelwire.log.share.server import PERIOD_S, AttachedStops
from wheelwire.log.share.wire import Say, tagged
from wheelwire_protocol.codes import StopMode, SupervisorState
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import Ack, Estop, SetWheelVelocity, Stop, WheelState

ACK = Ack(0, 1, 2)


class Posting:
    """Takes what `AttachedStops` posts, and its wake-ups."""

    def __init__(self) -> None:
        self.posted: list[Done] = []
        self.wakes = 0
        self.error: WheelwireError | None = None
        self.stops = AttachedStops(self.post, self.wake)
        self.answers: list[tuple[str, Answer | WheelwireError]] = []

    def post(self, done: Done) -> None:
        if self.error is not None:
            raise self.error
        self.posted.append(done)

    def wake(self) -> None:
        self.wakes += 1

    def ask(self, name: str) -> None:
        self.stops.ask(lambda result: self.answers.append((name, result)))

    @property
    def answered(self) -> str:
        return "".join(name for name, _ in self.answers)


@pytest.fixture
def posting() -> Posting:
    return Posting()


# --- several at once -----------------------------------------------------------------------------


def test_stops_of_one_moment_are_one_and_each_is_answered(posting: Posting) -> None:
    for name in "abc":
        posting.ask(name)
    assert posting.stops.due_s() == 0.0
    posting.stops.advance(100.0)
    assert len(posting.posted) == 1
    posting.posted[0](ACK)
    assert posting.wakes == 1
    posting.stops.advance(100.001)
    assert posting.answers == [(name, ACK) for name in "abc"]


def test_one_that_comes_while_another_is_under_way_is_sent_after_it(posting: Posting) -> None:
    """The owner may have driven since that one was sent."""
    posting.ask("a")
    posting.stops.advance(100.0)
    posting.ask("b")
    posting.ask("c")
    posting.stops.advance(100.5)
    assert len(posting.posted) == 1
    assert posting.stops.due_s() is None  # the answer wakes it
    posting.posted[0](ACK)
    posting.stops.advance(101.0)
    assert posting.answered == "a"
    assert len(posting.posted) == 2
    posting.posted[1](ACK)
    posting.stops.advance(101.1)
    assert posting.answered == "abc"


def test_there_is_no_more_than_one_stop_in_a_period(posting: Posting) -> None:
    now_s, answered = 100.0, 0
    while now_s < 101.0:
        posting.ask("a")
        posting.stops.advance(now_s)
        for done in posting.posted[answered:]:
            done(ACK)
        answered = len(posting.posted)
        now_s += 0.001
    assert answered == pytest.approx(1 / PERIOD_S, abs=2)
    # The last of them are sent at the end of the period.
    due_s = posting.stops.due_s()
    assert due_s is not None
    posting.stops.advance(due_s)
    assert len(posting.posted) == answered + 1


def test_a_failure_answers_all(posting: Posting) -> None:
    posting.error = LinkLost("gone")
    posting.ask("a")
    posting.ask("b")
    posting.stops.advance(100.0)
    assert posting.wakes == 1
    posting.stops.advance(100.0)
    assert posting.answers == [("a", posting.error), ("b", posting.error)]
    posting.error = None
    posting.ask("c")
    posting.stops.advance(101.0)
    assert len(posting.posted) == 1


# --- a session's ---------------------------------------------------------------------------------


def test_an_attached_stop_is_of_no_session_and_as_configured(line: VirtualLine) -> None:
    line.drive()
    line.run(0.05)
    results: list[object] = []
    line.session.stop_for_attached(results.append, line.now_us)
    line.run(0.05)
    stop = line.device.asked(Stop)[-1]
    assert (stop.session_id, stop.command_seq, stop.mode) == (0, 0, StopMode.CONFIGURED)
    assert [type(one) for one in results] == [Ack]
    assert line.device.supervisor is SupervisorState.IDLE


def test_the_owners_next_setpoint_drives_and_nothing_is_repeated(line: VirtualLine) -> None:
    line.device.lost.add(WheelState)  # so that the setpoint counts as unseen
    line.drive()
    line.session.stop_for_attached(lambda _: None, line.now_us)
    line.run(0.1)
    assert line.device.count(SetWheelVelocity) == 1
    line.drive()
    line.run(0.01)
    assert line.device.supervisor is SupervisorState.DRIVING


def test_an_answer_of_another_kind_of_stop_is_not_its_own(line: VirtualLine) -> None:
    foreign = line.statistics.foreign
    line.device.lost.add(Stop)
    results = line.post_stop()
    line.run(0.01)
    line.device.send(Ack(0, 1, 2))  # of no session, though the request was of this one
    line.run(0.01)
    assert results == []
    assert line.statistics.foreign > foreign


def test_without_a_session_a_stop_is_sent_and_says_so() -> None:
    line = VirtualLine()
    line.session.connect(line.now_us)
    results: list[object] = []
    line.session.stop_for_attached(results.append, line.now_us)
    line.write()
    assert len(line.sent_of(Stop)) == 1
    assert [type(one) for one in results] == [LinkLost]


def test_a_rerun_counts_as_the_session_does(line: VirtualLine) -> None:
    reader, rerun = TrafficReader(), Rerun()
    line.session.listen(reader, line.now_us)
    line.drive()
    line.session.stop_for_attached(lambda _: None, line.now_us)
    line.run(0.05)
    line.drive()
    line.run(0.05)
    rerun.feed_all(reader.take())
    assert rerun.session is not None
    followed = rerun.session.setpoints.newest
    assert followed == line.session.setpoints.newest
    assert followed is not None


def flood(device: PtyDevice, end: threading.Event) -> None:
    """Ask for stops as fast as the owner takes them, and read the answers."""
    holder = holder_of(str(device.path))
    frame = encode_frame(Stop(0, 0, 0, StopMode.COAST), 0)
    with holder.connection as peer:
        peer.settimeout(None)
        reads = threading.Thread(target=lambda: list(iter(lambda: peer.recv(65536), b"")))
        reads.start()
        tag = 0
        while not end.is_set():
            peer.sendall(b"".join(tagged(Say.ASK, tag + i, frame) for i in range(100)))
            tag += 100
        peer.shutdown(socket.SHUT_RDWR)
        reads.join()


# --- beside a program that drives ----------------------------------------------------------------


def test_an_attached_stop_names_its_program(device: PtyDevice, robot: SerialDriver) -> None:
    reader = TrafficReader()
    robot._link.listen_to_traffic(reader)
    with AttachedDriver(holder_of(str(device.path))) as attached:
        attached.stop()
        attached.estop()
        notes: list[bytes] = []

        def are_noted() -> bool:
            taken = [one.data for one in reader.take() if one.kind is Kind.NOTE]
            notes.extend(one for one in taken if STOP_ASKED.encode() in one)
            return len(notes) == 2

        wait_until(are_noted)  # a note comes after the stop, and perhaps after its answer
    assert all(f"process {os.getpid()}".encode() in one for one in notes)


def test_under_a_flood_the_owner_drives_and_is_obeyed(
    device: PtyDevice, robot: SerialDriver
) -> None:
    end = threading.Event()
    device.device.forget()
    begin_s = time.monotonic()
    with ExitStack() as stack:
        for _ in range(4):
            thread = threading.Thread(target=flood, args=(device, end))
            thread.start()
            stack.callback(thread.join)
        stack.callback(end.set)
        wait_until(lambda: device.device.count(Stop) > 3)
        took_s = []
        for _ in range(5):
            robot.set_wheel_velocity(0.1, 0.1)
            called_s = time.monotonic()
            robot.estop()
            took_s.append(time.monotonic() - called_s)
            robot.clear_estop()
            robot.set_wheel_velocity(0.0, 0.0)
        lasted_s = time.monotonic() - begin_s
    # Copies on a busy computer, and the owner's, included.
    stops = device.device.asked(Stop)
    assert len([m for m in stops if not m.session_id]) <= lasted_s / PERIOD_S + 2
    assert sorted(took_s)[2] < 0.2


def test_an_estop_goes_out_though_a_stop_is_under_way(
    device: PtyDevice, robot: SerialDriver
) -> None:
    robot.read()
    device.device.lost.add(Stop)  # its answers
    link = AttachedLink(LatestSample(), holder_of(str(device.path)), listens=False)
    link.open()
    for _ in range(50):
        link.post_stop(lambda _: None)
    link.estop()
    link.close()
    assert device.device.supervisor is SupervisorState.ESTOPPED
    assert device.device.count(Estop) > 0


# --- in another environment ----------------------------------------------------------------------


@pytest.mark.parametrize("offered_in", ["session", "temporary", "other temporary"])
def test_a_holder_in_another_environment_is_found(
    device: PtyDevice,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    offered_in: str,
) -> None:
    tmp_path = tmp_path_factory.mktemp("t")  # the path of a socket has to be short
    for name in ("mine", "run", "tmp", "tmp2"):
        (tmp_path / name).mkdir()
    user = os.getuid()
    (tmp_path / "run" / str(user)).mkdir()
    monkeypatch.delenv(sharing_folder.DIRECTORY_VARIABLE)
    monkeypatch.setattr(sharing_folder, "SESSIONS", str(tmp_path / "run"))
    monkeypatch.setattr(sharing_folder, "TEMPORARY", str(tmp_path / "tmp2"))
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    theirs = {
        "session": tmp_path / "run" / str(user) / "wheelwire",
        "temporary": tmp_path / "tmp" / f"wheelwire-{user}",
        "other temporary": tmp_path / "tmp2" / f"wheelwire-{user}",
    }[offered_in]
    monkeypatch.setenv(sharing_folder.DIRECTORY_VARIABLE, str(theirs))
    with SerialDriver(str(device.path)):
        holder_of(str(device.path)).connection.close()
        monkeypatch.delenv(sharing_folder.DIRECTORY_VARIABLE)
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "mine"))
        (tmp_path / "mine" / "wheelwire").mkdir(mode=0o700)
        holder = find_holder(str(device.path))
        assert holder is not None
        holder.connection.close()
        # A folder that others can enter is not searched.
        theirs.chmod(0o755)
        assert find_holder(str(device.path)) is None
        theirs.chmod(0o700)


def test_a_named_folder_is_the_only_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "named").mkdir(mode=0o700)
    monkeypatch.setenv(sharing_folder.DIRECTORY_VARIABLE, str(tmp_path / "named"))
    assert [one.path for one in sharing_folder.sharing_folders()] == [tmp_path / "named"]
