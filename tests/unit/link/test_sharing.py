"""A link that is offered to other programs, and one that is attached to it."""

from __future__ import annotations

import gc
import os
import shutil
import socket
import stat
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from support.attached import holder_of, wait_for_holder
from support.core_device import CoreDevice
from support.forking import forked
from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.attached import AttachedDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link import sharing
from wheelwire.link.connection import Link
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.sharing import SharingServer
from wheelwire.link.sharing_folder import DIRECTORY_VARIABLE, GROUP_VARIABLE
from wheelwire.link.traffic import Kind, TrafficReader
from wheelwire.log.share import attached_link as attached_module
from wheelwire.log.share import server as serving
from wheelwire.log.share.attached_link import AttachedLink, find_holder
from wheelwire.log.share.server import _Program
from wheelwire.log.share.wire import VERSION, Say, message, tagged
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import (
    READ_ONLY,
    BoardSet,
    ClearEstop,
    ClearFault,
    ConfigurationConfirm,
    ConfigurationWrite,
    Estop,
    ParameterGet,
    ParameterReset,
    ParameterSave,
    ParameterSet,
    ParameterTrial,
    PeripheralSet,
    Restart,
    SensorStream,
    SetDuty,
    SetStreamRate,
    SetWheelVelocity,
    Stop,
)

BOARD_ID = "240ac4123456"


def folder() -> Path:
    return Path(os.environ[DIRECTORY_VARIABLE])


def names() -> list[str]:
    """All but the record of who drove, which outlives the programs."""
    found = folder().iterdir() if folder().is_dir() else ()
    return sorted(path.name for path in found if path.suffix != ".programs")


@pytest.fixture
def attached(device: PtyDevice, robot: SerialDriver) -> Iterator[AttachedDriver]:
    assert robot.is_open
    with AttachedDriver(holder_of(str(device.path))) as attached:
        yield attached


@contextmanager
def attached_link(device: PtyDevice, latest: LatestSample | None = None) -> Iterator[AttachedLink]:
    link = AttachedLink(latest or LatestSample(), holder_of(str(device.path)))
    link.open()
    with closing(link):
        yield link


def offered(name: str = f"{BOARD_ID}.tap") -> Path:
    """The socket's file, once somebody listens there."""
    path = folder() / name

    def answers() -> bool:
        with socket.socket(socket.AF_UNIX) as probe:
            return probe.connect_ex(str(path)) == 0

    wait_until(answers)
    return path


@contextmanager
def peer_at(path: Path) -> Iterator[socket.socket]:
    """The other end of a tap's socket, byte by byte."""
    with socket.socket(socket.AF_UNIX) as peer:
        peer.settimeout(5.0)
        peer.connect(str(path))
        yield peer


def is_cut_off(peer: socket.socket) -> bool:
    try:
        while peer.recv(65536):
            pass
    except ConnectionResetError:
        return True
    except TimeoutError:
        return False
    return True


# --- the file ------------------------------------------------------------------------------------


def test_the_file_is_for_this_user_alone_and_goes_with_the_link(device: PtyDevice) -> None:
    with SerialDriver(str(device.path)):
        path = offered()
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert stat.S_IMODE(folder().stat().st_mode) == 0o700
    assert names() == []


def test_a_link_may_be_offered_to_nobody(device: PtyDevice) -> None:
    with SerialDriver(str(device.path), tap=False) as robot:
        robot.read()
        assert find_holder(str(device.path)) is None
    assert names() == []


def test_off_and_on_are_all_there_is(device: PtyDevice) -> None:
    with pytest.raises(errors.InvalidArgument, match="tap"):
        SerialDriver(str(device.path), tap="no")  # type: ignore[arg-type]


def test_what_a_killed_program_left_is_replaced(device: PtyDevice) -> None:
    folder().mkdir(mode=0o700)
    left = socket.socket(socket.AF_UNIX)
    left.bind(str(folder() / f"{BOARD_ID}.tap"))
    left.close()  # the file stays, as after SIGKILL
    with SerialDriver(str(device.path)):
        wait_for_holder(str(device.path))
        assert names() == [f"{BOARD_ID}.tap"]


def test_what_a_running_program_offers_stays(device: PtyDevice, tmp_path: Path) -> None:
    with PtyDevice(tmp_path / "other", CoreDevice()) as other, SerialDriver(str(device.path)):
        offered()
        with SerialDriver(str(other.path)):
            offered(f"{BOARD_ID}-2.tap")
            for each in (device, other):
                holder = holder_of(str(each.path))
                assert holder.port == str(each.path.resolve())
                holder.connection.close()
        assert names() == [f"{BOARD_ID}.tap"]


def test_a_file_of_another_kind_stays(device: PtyDevice) -> None:
    folder().mkdir(mode=0o700)
    (folder() / f"{BOARD_ID}.tap").write_text("mine")
    with SerialDriver(str(device.path)):
        offered(f"{BOARD_ID}-2.tap")
    assert (folder() / f"{BOARD_ID}.tap").read_text() == "mine"


def test_a_removed_folder_is_made_again(device: PtyDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharing, "LOOK_S", 0.05)
    with SerialDriver(str(device.path)) as robot:
        for _ in range(2):
            offered()
            shutil.rmtree(folder())
            wait_for_holder(str(device.path))
            robot.read()


def test_a_file_that_is_another_programs_by_now_is_left_to_it(
    device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sharing, "LOOK_S", 60.0)
    with SerialDriver(str(device.path)):
        path = offered()
        path.unlink()
        with closing(socket.socket(socket.AF_UNIX)) as other:
            other.bind(str(path))
    assert names() == [path.name]


@pytest.mark.parametrize("mode", [0o750, 0o705, 0o777])
def test_a_folder_that_others_get_into_is_refused(
    device: PtyDevice, mode: int, caplog: pytest.LogCaptureFixture
) -> None:
    folder().mkdir()
    folder().chmod(mode)
    with SerialDriver(str(device.path)) as robot:
        wait_until(lambda: "not a folder that only this user" in caplog.text)
        robot.read()
        assert names() == []
    # Once, however often it is tried.
    assert len([one for one in caplog.records if one.name == "wheelwire.share"]) == 1


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_refused(device: PtyDevice) -> None:
    folder().mkdir(mode=0o700)
    os.chown(folder(), 4711, -1)
    with SerialDriver(str(device.path)) as robot:
        robot.read()
        time.sleep(0.1)
        assert names() == []
        assert find_holder(str(device.path)) is None


def test_a_group_that_is_named_may_use_it(
    device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    import grp

    own = grp.getgrgid(os.getgid())
    monkeypatch.setenv(GROUP_VARIABLE, own.gr_name)
    with SerialDriver(str(device.path)):
        path = offered()
        wait_until(lambda: stat.S_IMODE(path.stat().st_mode) == 0o660)
        assert path.stat().st_gid == own.gr_gid
        assert stat.S_IMODE(folder().stat().st_mode) == 0o750
        wait_for_holder(str(device.path))


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")
def test_another_user_is_sent_away(robot: SerialDriver) -> None:
    path = offered()

    def child() -> None:
        path.chmod(0o666)
        os.chdir(path.parent)  # whose own folders that user must not enter
        path.parent.chmod(0o711)
        os.setuid(4711)
        with peer_at(Path(path.name)) as peer:
            assert not peer.recv(100)

    with forked(child):
        robot.read()


def test_the_file_follows_the_board(device: PtyDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharing, "LOOK_S", 0.05)
    with SerialDriver(str(device.path), any_board=True) as robot:
        offered()
        device.unplug()
        device.device.board_id = 0x240AC4AAAAAA
        device.device.reset()
        device.plug()
        wait_until(lambda: robot.is_open and names() == ["240ac4aaaaaa.tap"])
        assert find_holder("", BOARD_ID) is None
        wait_for_holder("", "240ac4aaaaaa")


def test_a_driver_that_nobody_has_any_more_ends(device: PtyDevice) -> None:
    robot = SerialDriver(str(device.path))
    attached = AttachedDriver(holder_of(str(device.path)))
    gone = weakref.ref(robot)
    del robot
    gc.collect()
    assert gone() is None
    wait_until(lambda: names() == [])
    attached.close()


def link_of(attached: AttachedDriver) -> AttachedLink:
    link = attached._link
    assert isinstance(link, AttachedLink)
    return link


def server_of(robot: SerialDriver) -> SharingServer:
    link = robot._link
    assert isinstance(link, Link)
    assert link._sharing_server is not None
    return link._sharing_server


def programs_of(server: SharingServer) -> list[_Program]:
    return [] if server._programs is None else list(server._programs._programs.values())


def is_full(program: _Program) -> bool:
    records = program._records
    return bool(program._output) and records is not None and len(records._queue) == 50


def void(_: object) -> None:
    """A callback that returns nothing."""


# --- reading -------------------------------------------------------------------------------------


def test_what_the_owner_measures_and_knows(robot: SerialDriver, attached: AttachedDriver) -> None:
    ours = {robot.read().t_us for _ in range(20)}
    theirs = {attached.read().t_us for _ in range(20)}
    assert max(theirs) > min(ours)
    assert attached.info.device == robot.info.device
    assert attached.info.port == robot.info.port
    assert attached.geometry == robot.geometry
    assert attached.statistics.sessions == 1
    robot.parameters.set("max_duty", 0.5)
    assert attached.parameters.list() == robot.parameters.list()
    assert attached.parameters["max_duty"] == 0.5
    assert attached.device_counters().frames_received
    assert attached.contradictions() == 0
    attached.control_counters()


def test_a_lost_link_is_waited_for(
    device: PtyDevice, robot: SerialDriver, attached: AttachedDriver
) -> None:
    attached.read()
    device.unplug()
    wait_until(lambda: not attached.is_open)
    with pytest.raises(errors.LinkLost, match="unplugged"):
        attached.read(0.1)
    # A program that comes now learns the reason, too.
    with (
        AttachedDriver(holder_of("", BOARD_ID)) as late,
        pytest.raises(errors.LinkLost, match="gone"),
    ):
        late.read(0.1)
    device.plug()
    attached.read(5.0)
    robot.read(5.0)


def test_the_end_of_the_owner_is_the_end(robot: SerialDriver, attached: AttachedDriver) -> None:
    robot.shutdown()
    wait_until(lambda: attached._link.has_ended)
    with pytest.raises(errors.LinkClosed, match=f"process {os.getpid()}, which held"):
        attached.read()


def test_nobody_misses_a_record_because_another_one_comes(
    device: PtyDevice, robot: SerialDriver, attached: AttachedDriver
) -> None:
    own = TrafficReader()
    robot._link.listen_to_traffic(own)
    for _ in range(3):
        with AttachedDriver(holder_of(str(device.path))) as other:
            for each in (attached, other):
                for _ in range(3):
                    each.read()
            assert link_of(other).lost == 0
    own.take()
    assert (link_of(attached).lost, own.lost) == (0, 0)


def test_a_late_program_gets_what_was_said_before(device: PtyDevice, robot: SerialDriver) -> None:
    robot.note("weather", "rain")
    robot.note("weather", "sun")
    reader = TrafficReader()
    with AttachedDriver(holder_of(str(device.path))) as attached:
        link_of(attached).listen_to_traffic(reader)
        notes: list[bytes] = []

        def has_come() -> bool:
            notes.extend(one.data for one in reader.take() if one.kind is Kind.NOTE)
            return bool(notes)

        wait_until(has_come)
    assert notes == [b'{"weather": "sun"}']


# --- stopping ------------------------------------------------------------------------------------


def test_an_attached_program_may_stop_the_robot(
    robot: SerialDriver, attached: AttachedDriver, device: PtyDevice
) -> None:
    robot.set_velocity(0.2, 0.0, ttl=5.0)
    wait_until(lambda: device.device.supervisor is SupervisorState.DRIVING)
    attached.stop()
    assert device.device.count(Stop) > 0
    assert device.device.supervisor is SupervisorState.IDLE
    robot.set_velocity(0.2, 0.0, ttl=5.0)  # a stop latches nothing


def test_an_attached_program_may_latch_it(
    robot: SerialDriver, attached: AttachedDriver, device: PtyDevice
) -> None:
    attached.estop()
    assert device.device.supervisor is SupervisorState.ESTOPPED
    wait_until(lambda: robot.read().state is SupervisorState.ESTOPPED)
    with pytest.raises(errors.DeviceRefused):
        robot.set_velocity(0.2, 0.0, ttl=0.5)


def test_estop_needs_nothing_to_be_read(robot: SerialDriver, device: PtyDevice) -> None:
    with AttachedDriver(holder_of(str(device.path)), listens=False) as attached:
        attached.estop()
        assert not robot._link.traffic.readers
    assert device.device.supervisor is SupervisorState.ESTOPPED


def test_estop_without_a_session_is_sent_and_says_so(
    robot: SerialDriver, attached: AttachedDriver, device: PtyDevice
) -> None:
    device.device.mute = True
    wait_until(lambda: not robot.is_open)
    device.device.received.clear()
    with pytest.raises(errors.LinkLost):
        attached.estop()
    wait_until(lambda: device.device.count(Estop) > 0)


# --- what is refused -----------------------------------------------------------------------------


CHANGES = (
    ConfigurationConfirm(0, 0, 0),
    ConfigurationWrite(0, 0, 0, 0),
    ClearEstop(0, 0),
    ClearFault(0, 0),
    ParameterReset(0, 0),
    ParameterSave(0, 0, 1),
    ParameterSet(0, 0, 1, 1.0),
    ParameterTrial(0, 0, 0, 1.0),
    Restart(0, 0),
    SensorStream(0, 0, 0),  # ends what others may use
    SetStreamRate(0, 0, 100),
)


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: type(change).__name__)
def test_a_change_is_refused(
    attached: AttachedDriver, device: PtyDevice, change: ParameterSet
) -> None:
    before = len(device.device.asked(type(change)))
    with pytest.raises(errors.InvalidCommand, match=f"^{type(change).__name__}: .* process "):
        attached._link.request(change)
    assert len(device.device.asked(type(change))) == before


def test_the_sensors_samples_are_asked_for_once() -> None:
    for has, wanted, passes in ((0, 200, True), (0, 0, False), (200, 100, False)):
        link: Any = SimpleNamespace(sensors=SimpleNamespace(rate_hz=has))
        assert serving._only_begins(SensorStream(0, 0, wanted), link) is passes


def test_only_what_is_listed_is_passed_on() -> None:
    from typing import get_args

    from wheelwire.link.requests import RequestMessage

    changing = {type(change) for change in CHANGES} | {BoardSet, PeripheralSet}
    assert set(get_args(RequestMessage)) == {*READ_ONLY, Stop, Estop, *changing}


@pytest.mark.parametrize(
    "setpoint",
    [SetWheelVelocity(0, 1, 0, 0.1, 0.1), SetDuty(0, 1, 0, 100, 100)],
    ids=lambda one: type(one).__name__,
)
@pytest.mark.usefixtures("robot")
def test_a_setpoint_is_refused(device: PtyDevice, setpoint: SetWheelVelocity) -> None:
    device.device.forget()
    with peer_at(offered()) as peer:
        peer.sendall(VERSION + tagged(Say.ASK, 7, encode_frame(setpoint, 0)))
        data = b""
        while type(setpoint).__name__.encode() not in data:
            data += peer.recv(65536)
    assert b"InvalidCommand" in data
    assert not device.device.obeyed


def test_driving_is_refused(attached: AttachedDriver, device: PtyDevice) -> None:
    device.device.forget()
    for drive in (attached.set_velocity, attached.set_duty):
        with pytest.raises(errors.InvalidCommand, match="alone drives"):
            drive(0.1, 0.0, ttl=0.3)
    with pytest.raises(errors.InvalidCommand):
        attached.clear_estop()
    assert not device.device.obeyed


@pytest.mark.parametrize(
    "said",
    [
        b"\x07",
        VERSION + b"\xff" * 5,
        VERSION + message(Say.STATUS),
        VERSION + message(Say.ASK, b"1"),
        VERSION + tagged(Say.ASK, 1, b"nonsense"),
        VERSION + b"\x00\x00\x00\x00\xc8",
    ],
)
def test_nonsense_is_cut_off(robot: SerialDriver, said: bytes) -> None:
    with peer_at(offered()) as peer:
        peer.sendall(said)
        assert is_cut_off(peer)
    robot.read()


def test_one_program_too_many_is_sent_away(robot: SerialDriver) -> None:
    path = offered()
    with ExitStack() as stack:
        for _ in range(sharing.MAX_PROGRAMS):
            assert stack.enter_context(peer_at(path)).recv(1)
        with peer_at(path) as one_more:
            assert is_cut_off(one_more)
    robot.read()


# --- slow and broken programs --------------------------------------------------------------------


def test_a_slow_program_loses_its_own_copies_and_starts_again(
    device: PtyDevice, robot: SerialDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving, "QUEUE", 50)
    latest_sample, reader, goes_on = LatestSample(), TrafficReader(), threading.Event()
    with attached_link(device, latest_sample) as link:
        server = server_of(robot)
        for program in programs_of(server):
            program.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        link.listen_to_traffic(reader)
        latest_sample.notify_all = lambda: void(goes_on.wait())  # by the thread that reads
        wait_until(lambda: any(is_full(one) for one in programs_of(server)))
        goes_on.set()
        wait_until(lambda: link.lost > 0)
        newest = robot.read().t_us
        wait_until(lambda: link._is_open and latest_sample.take(1.0).t_us > newest)
        kinds = [record.kind for record in reader.take()]
        assert kinds.count(Kind.START) >= 2
    robot.read()
    assert robot.statistics.frames_lost == 0


def test_one_that_reads_nothing_costs_bounded_memory(
    robot: SerialDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving, "BACKLOG", 10_000)
    frame = encode_frame(ParameterGet(0, 0, 1), 0)
    asks = b"".join(tagged(Say.ASK, tag, frame) for tag in range(100_000))
    with peer_at(offered()) as peer:
        peer.sendall(VERSION)
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            peer.sendall(asks)
    robot.read()


def test_a_tag_in_flight_cannot_be_used_again(device: PtyDevice, robot: SerialDriver) -> None:
    frame = encode_frame(ParameterGet(0, 0, 1), 0)
    device.device.lost = {ParameterGet}
    with peer_at(offered()) as peer:
        peer.sendall(VERSION + 2 * tagged(Say.ASK, 7, frame))
        assert is_cut_off(peer)
    robot.read()


def test_one_that_says_nothing_keeps_nobody_from_the_others(
    device: PtyDevice, robot: SerialDriver
) -> None:
    path = offered()
    with socket.socket(socket.AF_UNIX) as silent:
        silent.bind(str(path.with_name("000000000000.tap")))
        silent.listen()
        begin_s = time.monotonic()
        holder = find_holder(str(device.path))
        assert holder is not None
        holder.connection.close()
        assert time.monotonic() - begin_s < attached_module.GREETING_S
        silent.accept()[0].close()
    robot.read()
