import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from wheelwire.link import ports


def comport(device: str, vid: int | None, pid: int | None) -> SimpleNamespace:
    return SimpleNamespace(device=device, vid=vid, pid=pid, description="x", serial_number="0001")


def test_likely_boards_come_first_and_a_doubtful_one_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [
        comport("/dev/ttyS0", None, None),
        comport("/dev/ttyUSB1", 0x10C4, 0xEA60),
        comport("/dev/ttyACM0", 0x303A, 0x1001),
    ]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    by_path = tmp_path / "by-path"
    by_path.mkdir()
    (by_path / "usb-0:1.2").symlink_to("/dev/ttyUSB1")
    acm, usb, onboard = ports.list_serial_ports(by_path)
    assert [p.device for p in (acm, usb, onboard)] == ["/dev/ttyACM0", "/dev/ttyUSB1", "/dev/ttyS0"]
    assert "RPLidar" in usb.note
    assert usb.likely_esp32
    assert usb.by_path == str(by_path / "usb-0:1.2")
    assert not onboard.likely_esp32
    assert onboard.by_path is None


def test_a_port_that_a_process_holds_is_in_use() -> None:
    master, slave = os.openpty()
    try:
        assert ports.is_in_use(os.ttyname(slave)) is True
    finally:
        os.close(slave)
        os.close(master)


def test_a_port_is_free_only_when_every_process_could_be_seen(tmp_path: Path) -> None:
    files = tmp_path / "1" / "fd"
    files.mkdir(parents=True)
    (files / "0").symlink_to("/dev/other")
    assert ports.is_in_use("/dev/mine", tmp_path) is False
    (tmp_path / "2").mkdir()  # it ended while we looked
    assert ports.is_in_use("/dev/mine", tmp_path) is False


def test_a_process_that_cannot_be_seen_leaves_it_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "1").mkdir()

    def deny(_: Path) -> list[Path]:
        raise PermissionError

    monkeypatch.setattr(Path, "iterdir", deny)
    assert ports.is_in_use("/dev/mine", tmp_path) is None
