"""What is latched on this computer's pins outlives the process that moves them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from support.library_robot import LibraryRobot
from wheelwire.errors import ConfigurationError
from wheelwire.pi import storage
from wheelwire.pi.core import make_core
from wheelwire.pi.pins import Pins
from wheelwire.pi.settings import McuSettings
from wheelwire.pi.storage import latch_file, runtime_directory
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.types import ClearEstop, Estop

SETTINGS = McuSettings("l298n", Pins())


def state_after_a_start(*messages: Estop | ClearEstop) -> SupervisorState:
    """Start a core, send it these, and end it without a word, as SIGKILL does."""
    robot = LibraryRobot(make_core(SETTINGS)).open()
    for message in messages:
        robot.request(message)
    return robot.step().state


def test_an_estop_outlives_the_process_until_it_is_cleared() -> None:
    assert state_after_a_start() is SupervisorState.IDLE
    assert state_after_a_start(Estop(0, 0)) is SupervisorState.ESTOPPED
    assert state_after_a_start() is SupervisorState.ESTOPPED
    assert state_after_a_start(ClearEstop(0, 0)) is SupervisorState.IDLE
    assert state_after_a_start() is SupervisorState.IDLE


@pytest.mark.parametrize("content", [b"", b"x", bytes(12), bytes(1000)])
def test_a_record_that_cannot_be_read_is_an_estop(content: bytes) -> None:
    state_after_a_start()
    record = next(runtime_directory().glob("*.latch"))
    record.write_bytes(content)
    assert state_after_a_start() is SupervisorState.ESTOPPED


def test_a_record_that_is_a_directory_is_an_estop(capfd: pytest.CaptureFixture[str]) -> None:
    state_after_a_start()
    record = next(runtime_directory().glob("*.latch"))
    record.unlink()
    record.mkdir()
    assert latch_file(SETTINGS).load() == storage.UNREADABLE
    assert "treated as an e-stop" in capfd.readouterr().err


def test_robots_on_other_pins_do_not_meet() -> None:
    assert state_after_a_start(Estop(0, 0)) is SupervisorState.ESTOPPED
    for other in (
        McuSettings("l298n", Pins(left_pwm=12)),
        McuSettings("pigpio", Pins()),
        McuSettings("pigpio", Pins(), host="robot.local"),
    ):
        assert latch_file(other).load() == b""


@pytest.mark.parametrize("mode", [0o777, 0o720])
def test_a_directory_that_others_can_write_to_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, mode: int
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(mode)
    monkeypatch.setenv(storage.DIRECTORY_VARIABLE, str(shared))
    with pytest.raises(ConfigurationError, match="only this user can write"):
        latch_file(SETTINGS)


def test_a_link_to_somebody_elses_directory_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    link = tmp_path / "link"
    link.symlink_to(tmp_path)
    monkeypatch.setenv(storage.DIRECTORY_VARIABLE, str(link))
    with pytest.raises(ConfigurationError):
        latch_file(SETTINGS)


def test_a_child_whose_parent_is_gone_says_so_in_one_line() -> None:
    from wheelwire.pi.__main__ import _pidfd_of_parent

    gone = os.fork()
    if gone == 0:
        os._exit(0)
    os.waitpid(gone, 0)
    with pytest.raises(SystemExit, match="the application ended"):
        _pidfd_of_parent(gone)
