"""What opening a link tells when it fails, on pseudo-terminals and sockets, in real time."""

import gc
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import wheelwire
from support.cases import each
from support.lost_answers import LostAnswers
from support.processes import open_files, talking
from support.pty_device import PtyDevice
from support.threads import link_threads
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.drivers.transport import TransportDriver
from wheelwire.link import connection as link
from wheelwire.link.transports import SerialTransport, SocketTransport, Transport
from wheelwire_protocol.codes import RefusalCode, SupervisorState
from wheelwire_protocol.types import AnyMessage, ConfigurationValue, DeviceHello, GroupInfo


def test_a_silent_port(device: PtyDevice) -> None:
    device.device.mute = True
    with pytest.raises(errors.DeviceSilent, match="at 921600") as told:
        SerialDriver(str(device.path), connect_timeout=0.3)
    # A busy computer may get to the next one.
    assert told.value.baud_rates[0] == 921_600


def test_the_baud_rate_at_which_the_device_answers_is_kept(
    device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.device.mute = True
    set_baud_rate = SerialTransport.set_baud_rate

    def set_and_hear(transport: SerialTransport, baud_rate: int) -> None:
        set_baud_rate(transport, baud_rate)
        device.device.mute = baud_rate != 115_200

    monkeypatch.setattr(SerialTransport, "set_baud_rate", set_and_hear)
    with SerialDriver(str(device.path)) as driver:
        assert driver.info.baud_rate == 115_200


def test_a_device_that_answers_but_lets_nobody_in(device: PtyDevice) -> None:
    device.device.edits[DeviceHello] = {"refusal": RefusalCode.BOOTING}
    with pytest.raises(errors.RequestTimeout, match="still starting"):
        SerialDriver(str(device.path), connect_timeout=0.3)


LOCKING = """
import fcntl, os, sys
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
fcntl.flock(port, fcntl.LOCK_EX)
print(flush=True)
input()
"""


def test_a_port_that_is_in_use(device: PtyDevice, tmp_path: Path) -> None:
    script = tmp_path / "hold_port.py"
    script.write_text(LOCKING)
    command = (sys.executable, script, device.path)
    with talking(*command, stdin=subprocess.PIPE) as (other, _):
        with pytest.raises(errors.PortUnavailable, match="another program uses it") as caught:
            SerialDriver(str(device.path))
        other.communicate("\n")
    named = f"hold_port.py port, process {other.pid}), and only one can: end that one"
    assert named in str(caught.value)
    assert "e-stop button" in str(caught.value)


@each(
    ("port", "said"),
    [
        ("/dev/does-not-exist", "no such port"),
        ("/run/does-not-exist", "`wheelwire sim` starts a simulated robot"),
        ("socket://host", "write it as socket://HOST:PORT"),
        ("socket://127.0.0.1:1", "nobody listens"),
        ("unix:", "write it as unix:PATH"),
        (__file__, "not a serial port"),
        ("loop://", "file descriptor"),
        ("nonsense://x", "nonsense"),
    ],
)
def test_a_name_that_leads_to_no_port(port: str, said: str) -> None:
    with pytest.raises(errors.PortUnavailable, match=said):
        SerialDriver(port)


def test_a_port_whose_opening_never_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = socket.socketpair()
    go_on = threading.Event()

    def open_port(_baud_rate: int) -> Transport:
        go_on.wait()
        return SocketTransport(ours)

    monkeypatch.setattr(link, "PORT_TIMEOUT_S", 0.05)
    monkeypatch.setattr(link, "CLOSE_TIMEOUT_S", 0.05)
    with theirs:
        with pytest.raises(errors.PortUnavailable, match="takes longer than"):
            TransportDriver("robot", open_port)
        go_on.set()
        wait_until(lambda: not link_threads())
        assert ours.fileno() < 0


def test_any_error_of_the_opening_is_raised_where_the_driver_is() -> None:
    def open_port(_baud_rate: int) -> Transport:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        TransportDriver("robot", open_port)
    assert not link_threads()


@pytest.mark.parametrize("kind", [GroupInfo, ConfigurationValue])
def test_a_robot_knows_its_board_once_it_is_open_or_restarted(
    monkeypatch: pytest.MonkeyPatch, kind: type[AnyMessage]
) -> None:
    lost = LostAnswers(monkeypatch, kind, 4)
    with wheelwire.open_driver("mock") as robot:
        opened = robot.info
        assert lost.left == 0
        lost.left = 4
        robot.board.restart()
        restarted = robot.info
        assert lost.left == 0
    assert opened.board is not None
    assert restarted.board == opened.board


def test_a_robot_that_never_names_its_board_opens_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    LostAnswers(monkeypatch, GroupInfo, 1_000_000)
    with wheelwire.open_driver("mock") as robot:
        assert robot.info.board is None
        wait_until(lambda: robot.read().state is SupervisorState.IDLE)  # the arming setpoint ends


def test_a_lost_port_leaves_no_descriptor(device: PtyDevice) -> None:
    # The tap's socket opens a moment later, and does not belong to the port.
    with SerialDriver(str(device.path), tap=False) as robot:
        before = len(open_files())
        for _ in range(3):
            device.unplug()
            wait_until(lambda: not robot.is_open)
            wait_until(lambda: len(open_files()) < before)  # neither the port's nor the device's
            device.plug()
            wait_until(lambda: robot.is_open)
            wait_until(lambda: len(open_files()) <= before)


def test_a_robot_that_is_forgotten_after_an_error_is_closed(device: PtyDevice) -> None:
    def use(robot: SerialDriver) -> None:
        device.unplug()
        wait_until(lambda: not robot.is_open)
        robot.set_velocity(0.1, 0.0)

    robot = SerialDriver(str(device.path))
    with pytest.raises(errors.LinkLost):
        use(robot)
    del robot
    gc.collect()
    wait_until(lambda: not link_threads())
