"""The names of a port: each leads to the device, and a wrong one gets the one that may be meant."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from support.cases import each
from wheelwire.errors import InvalidArgument
from wheelwire.link.ports import device_of, meant_port, port_name


@pytest.fixture
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A link to a terminal, in the working folder and at home."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    _, slave = os.openpty()
    link = tmp_path / "s1"
    link.symlink_to(os.ttyname(slave))
    (tmp_path / "folder").mkdir()
    return link


def test_all_names_of_a_device_are_one(device: Path) -> None:
    names = ["s1", "./s1", "folder/../s1", str(device), str(device.readlink()), "~/s1"]
    assert {device_of(port_name(name)) for name in names} == {str(device.readlink())}


def test_a_relative_name_outlives_a_change_of_the_folder(
    device: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = port_name("s1")
    monkeypatch.chdir("/")
    assert device_of(name) == str(device.readlink())


@pytest.mark.usefixtures("device")
def test_a_link_stays_a_link() -> None:
    """It may lead elsewhere when the board is plugged in again."""
    assert port_name("s1") == str(Path("s1").absolute())


@each(
    ("one", "other"),
    [
        ("unix:robot.sock", "unix:./robot.sock"),
        ("socket://localhost:3333", "socket://127.0.0.1:3333"),
        ("socket://LOCALHOST:3333", "socket://localhost:3333/"),
        ("socket://[::1]:3333", "socket://127.0.0.1:3333"),
        ("socket://Robot.local:3333", "socket://robot.local:3333"),
    ],
)
def test_other_names_that_mean_the_same(one: str, other: str) -> None:
    assert device_of(port_name(one)) == device_of(port_name(other))


@each(
    "name",
    [
        "l298n-0badcafe",
        "socket://a:1",
        "rfc2217://a:1",
        "/dev/ttyUSB*,/dev/ttyACM*",
        "0a1b2c3d4e5f",
        "unix:",
    ],
)
def test_a_name_that_is_no_path_stays(name: str) -> None:
    assert port_name(name) == name


def test_two_sockets_are_two() -> None:
    names = ("socket://a:1", "socket://a:2", "socket://b:1", "unix:/a", "unix:/b", "/dev/a")
    assert len({device_of(name) for name in names}) == len(names)
    assert device_of("socket://a:wrong") == "socket://a:wrong"


def test_without_a_home_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "expanduser", _no_home)
    with pytest.raises(InvalidArgument, match="no home folder"):
        port_name("~/s1")
    assert port_name("/dev/ttyUSB0") == "/dev/ttyUSB0"


def _no_home(path: Path) -> Path:
    if str(path).startswith("~"):
        raise RuntimeError("Could not determine home directory.")
    return path


@each(
    ("name", "expected"),
    [
        ("ttyUSB0", "did you mean /dev/ttyUSB0?"),
        ("/dev/ttyusb0", "did you mean /dev/ttyUSB0?"),
        ("ttyacm1", "did you mean /dev/ttyACM1?"),
        ("TTYS0", "did you mean /dev/ttyS0?"),
        ("null", "did you mean /dev/null?"),
        ("drive.mcp", "a recording's name ends in .mcap"),
        ("no-such-port", ""),
        ("robot.local", ""),
        ("/dev/ttyUSB0", ""),
        ("/dev/serial/by-id/x", ""),
    ],
)
def test_what_may_be_meant(name: str, expected: str) -> None:
    assert meant_port(name) == expected


def test_a_name_of_windows() -> None:
    assert "did you mean /dev/ttyUSB0?" in meant_port("COM3")
    assert "wsl" in meant_port("com12")
