"""The simulator's program: its port, its commands, its end.

On no line: what a line does to a link is tested where a link is opened.
"""

from __future__ import annotations

import fcntl
import json
import os
import select
import signal
import socket
import subprocess
import sys
import termios
import time
import tty
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.cases import each
from support.processes import talking
from support.waiting import wait_until
from wheelwire.errors import SimulatorNotFound, WheelwireError
from wheelwire.simulation import simulator as sim
from wheelwire.simulation.simulator import Simulator, find_simulator
from wheelwire_protocol import native
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.codes import ResetReason
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import DeviceHello, Hello, WheelState

TIMEOUT_S = 10.0
SILENCE_S = 0.5
HELLO = Hello(1, PROTOCOL_VERSION, schema_hash())
STATE_SIZE = 45
"""Bytes of a state's frame, at least."""


@contextmanager
def opened(port: str, speed: int = termios.B115200) -> Iterator[int]:
    fd = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(fd, termios.TCSANOW)
        settings = termios.tcgetattr(fd)
        settings[4] = settings[5] = speed
        termios.tcsetattr(fd, termios.TCSANOW, settings)
        yield fd
    finally:
        os.close(fd)


def say_hello(fd: int, timeout_s: float = TIMEOUT_S) -> DeviceHello | None:
    """The answer to a hello, repeated as a host does; None when none comes."""
    encoder, decoder = Encoder(), Decoder()
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        os.write(fd, encoder.encode(HELLO))
        if select.select([fd], [], [], 0.1)[0]:
            for message in decoder.feed(os.read(fd, 4096)):
                if isinstance(message, DeviceHello):
                    return message
    return None


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "robot"


def test_the_device_at_its_link_is_unplugged_plugged_and_reset(link: Path) -> None:
    link.symlink_to("/nowhere")  # a stale link is replaced
    with Simulator(link=link, baud_rate=921600) as simulator:
        with opened(simulator.port, termios.B115200) as fd:
            assert say_hello(fd, SILENCE_S) is None  # another rate garbles
        with opened(simulator.port, termios.B921600) as fd:
            first = say_hello(fd)
            simulator.unplug()
            assert not link.is_symlink()
            with pytest.raises(OSError, match="Input/output error"):
                os.write(fd, b"x")
        simulator.plug()
        with opened(simulator.port, termios.B921600) as fd:
            again = say_hello(fd)
            boot_id = simulator.reset(ResetReason.TASK_WATCHDOG)
            after = None
            while after is None or after.boot_id != boot_id:
                after = say_hello(fd)
        assert first is not None
        assert again is not None
        assert first.boot_id == again.boot_id != boot_id
        assert after.reset_reason == ResetReason.TASK_WATCHDOG
        link.unlink()
        link.symlink_to("/somebody/elses")
    assert link.is_symlink()


def first_state_is_new(simulator: Simulator) -> bool:
    """Whether the first state is new after the port was closed while the session went on."""
    closed_us = simulator.get("device_us")
    wait_until(lambda: simulator.get("device_us") >= closed_us + 2e6, what="2 s simulated")
    # Whatever the time between these lines, in the simulation and here: only what was sent
    # before the port was opened is old.
    opened_us = simulator.get("device_us")
    states: list[WheelState] = []
    with opened(simulator.port) as fd:
        decoder = Decoder()
        while not states:
            assert select.select([fd], [], [], TIMEOUT_S)[0], "nothing came"
            found = decoder.feed(os.read(fd, 4096))
            states += [message for message in found if isinstance(message, WheelState)]
    return states[0].t_us > opened_us - 100_000


def test_a_port_that_nobody_reads_keeps_nothing_old(simulator: Simulator) -> None:
    with opened(simulator.port) as fd:
        assert say_hello(fd) is not None
    # What is written to a terminal can be read a moment later. On a busy computer that looks
    # as if somebody had read it, and what comes is then kept for another second.
    assert any(first_state_is_new(simulator) for _ in range(5))


def unread(end: socket.socket) -> int:
    """Bytes that can be read."""
    count = array("i", [0])
    fcntl.ioctl(end.fileno(), termios.FIONREAD, count)
    return count[0]


def test_a_busy_host_finds_the_states_of_some_time_in_its_socket() -> None:
    """As in the buffer of a serial port, although the kernel counts a socket's by what it adds."""
    ours, theirs = socket.socketpair()
    with ours, Simulator(socket=theirs):
        assert say_hello(ours.fileno()) is not None
        wait_until(lambda: unread(ours) > 70 * STATE_SIZE, what="the states of 0.7 s")


@each(
    "line",
    ["", "dance", "set mass_kg", "set mass_kg heavy", "set mass_kg nan", "set colour 1",
     "set true.x_m 1", "get colour", "reset because", "plug", 'get "\\\x01'],
)  # fmt: skip
def test_a_bad_command_is_refused_with_a_reason(simulator: Simulator, line: str) -> None:
    mass = simulator.get("mass_kg")
    with pytest.raises(WheelwireError, match="refused"):
        simulator.command(line)
    assert simulator.get("mass_kg") == mass


def test_a_numbered_command_has_its_number_in_its_answer() -> None:
    lines = "#7 get drive_on\n#8 get nonsense\nget drive_on\n#x get drive_on\n#9\nquit\n"
    process = subprocess.run(
        [str(find_simulator())], input=lines, capture_output=True, encoding="utf-8", check=True
    )
    answers = [json.loads(line) for line in process.stdout.splitlines()][1:]
    assert [(answer.get("number"), answer["ok"]) for answer in answers] == [
        (7, True),
        (8, False),
        (None, True),
        (None, False),
        (9, False),
        (None, True),
    ]


@pytest.mark.parametrize("settings", [{"colour": 1.0}, {"mass_kg": -1.0}])
def test_a_bad_setting_is_named_at_the_start(settings: dict[str, float]) -> None:
    with pytest.raises(WheelwireError, match=next(iter(settings))):
        Simulator(settings=settings).start()


def test_a_file_in_the_links_place_is_left_alone(link: Path) -> None:
    link.write_text("mine")
    with pytest.raises(WheelwireError, match="not a link"):
        Simulator(link=link).start()
    assert link.read_text() == "mine"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(link: Path, number: signal.Signals) -> None:
    command = (find_simulator(), f"--link={link}")
    with talking(*command, stdin=subprocess.DEVNULL) as (process, line):
        ready = json.loads(line)
        assert ready["event"] == "ready"
        assert str(link.readlink()) == ready["port"]
        process.send_signal(number)
        assert process.wait(TIMEOUT_S) == 0
    assert not link.is_symlink()


def test_it_ends_when_its_parent_is_killed(link: Path) -> None:
    script = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from wheelwire.simulation.simulator import Simulator\n"
        "simulator = Simulator(link=Path(sys.argv[1]))\n"
        "simulator.start()\n"
        "print(simulator.pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    with talking(sys.executable, "-c", script, link) as (_, pid):
        pass
    wait_until(lambda: not Path(f"/proc/{int(pid)}").exists(), what="its end")
    assert not link.is_symlink()


def test_simulated_time_keeps_pace_with_the_wall_clock(simulator: Simulator) -> None:
    """It makes up for what a busy computer kept it from."""

    def ahead_us() -> float:
        return simulator.get("t_us") - time.monotonic() * 1e6

    begin_us = ahead_us()
    time.sleep(0.5)
    wait_until(lambda: abs(ahead_us() - begin_us) < 50_000)


def test_which_simulator_is_run_and_what_is_said_of_a_missing_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("WHEELWIRE_FWSIM", str(tmp_path / "missing"))
    with pytest.raises(SimulatorNotFound, match="WHEELWIRE_FWSIM"):
        find_simulator()
    monkeypatch.delenv("WHEELWIRE_FWSIM")
    installed = tmp_path / "installed"
    installed.mkdir()
    (installed / sim.PROGRAM).touch(0o755)
    monkeypatch.setattr(sim, "_PACKAGE", installed)
    assert find_simulator().parent.name == "host"  # a checkout runs its own build
    monkeypatch.setattr(native, "_CHECKOUT", tmp_path)
    assert find_simulator().parent == installed
    (installed / sim.PROGRAM).unlink()
    with pytest.raises(SimulatorNotFound, match="install a wheel of wheelwire"):
        find_simulator()
    (tmp_path / "firmware").mkdir()
    with pytest.raises(SimulatorNotFound, match="make sim"):
        find_simulator()
