"""The serial ports of this computer: data only, and none is opened to find out.

Opening a port asserts DTR, which stops a lidar's motor and may reset a board.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

from serial.tools import list_ports

PSEUDO_TERMINALS = "/dev/pts/"
"""Where they are; each has a program instead of a device at its other end."""

BRIDGES = {
    (0x10C4, 0xEA60): "CP210x: an ESP32 board, or an RPLidar (same ids); identify by handshake",
    (0x1A86, 0x7523): "CH340: an ESP32 board, or an Arduino clone",
    (0x1A86, 0x55D4): "CH9102: an ESP32 board",
    (0x0403, 0x6001): "FT232: an ESP32 board, or any serial adapter",
    (0x0403, 0x6010): "FT2232: an ESP32 board with a debugger, or any serial adapter",
    (0x0403, 0x6015): "FT231X: an ESP32 board, or any serial adapter",
    (0x303A, 0x1001): "native USB of an ESP32-S3, -C3 or -C6",
}


@dataclass(frozen=True)
class SerialPort:
    """One serial port.

    Attributes:
        device: Such as `/dev/ttyUSB0`; may change at the next plugging.
        by_path: A name that stays with the USB socket; None when the system gives none.
        description: The system's.
        vendor_id: None when it is no USB port.
        product_id: None when it is no USB port.
        serial_number: Many bridges have none, or all the same.
        likely_esp32: The bridge is one that ESP32 boards have.
        note: What the bridge may belong to; empty when it is not known.
        in_use: Some process has it open; None: that cannot be seen without root.
    """

    device: str
    by_path: str | None
    description: str
    vendor_id: int | None
    product_id: int | None
    serial_number: str | None
    likely_esp32: bool
    note: str
    in_use: bool | None


def list_serial_ports(by_path: Path = Path("/dev/serial/by-path")) -> list[SerialPort]:
    """The serial ports there are, likely ESP32 boards first."""
    stable = _stable_names(by_path)
    found = []
    for port in list_ports.comports():
        note = BRIDGES.get((port.vid, port.pid), "")
        found.append(
            SerialPort(
                device=port.device,
                by_path=stable.get(final_name(port.device)),
                description=port.description,
                vendor_id=port.vid,
                product_id=port.pid,
                serial_number=port.serial_number,
                likely_esp32=bool(note),
                note=note,
                in_use=is_in_use(port.device),
            )
        )
    return sorted(found, key=lambda port: (not port.likely_esp32, port.device))


def ports() -> list[SerialPort]:
    """The serial ports of this computer, likely robots first: as `wheelwire ports` lists them."""
    return list_serial_ports()


def likely_boards() -> list[SerialPort]:
    """The ports whose USB ids are those of a bridge that ESP32 boards have."""
    return [port for port in list_serial_ports() if port.likely_esp32]


def is_in_use(device: str, proc: Path = Path("/proc")) -> bool | None:
    """Whether some process has `device` open; None when not all processes can be looked into."""
    target = final_name(device)
    answers = {_has_open(process, target) for process in proc.glob("[0-9]*")}
    # One process that has it open decides, whatever cannot be seen of the others.
    if True in answers:
        return True
    return None if None in answers else False


def lock_holder(device: str) -> int | None:
    """The process that has locked a port as pyserial does; None: not known.

    This reads one small file, where `is_in_use` looks into every process.
    """
    proc = Path("/proc")
    with suppress(OSError):
        status = Path(device).stat()
        major, minor = os.major(status.st_dev), os.minor(status.st_dev)
        # As the kernel writes it: device numbers in hexadecimal, the inode in decimal.
        target = f"{major:02x}:{minor:02x}:{status.st_ino}"
        for line in (proc / "locks").read_text("utf-8").splitlines():
            # 1: FLOCK  ADVISORY  WRITE 4711 00:16:9 0 EOF
            kind, pid, file = itemgetter(1, 4, 5)(line.split())
            if kind == "FLOCK" and file == target:
                return int(pid)
    return None


def final_name(device: str | Path) -> str:
    """Where links to a device lead; its own name when one vanishes meanwhile: it was unplugged."""
    try:
        return str(Path(device).resolve())
    except FileNotFoundError:
        return str(device)


def _has_open(process: Path, target: str) -> bool | None:
    try:
        return any(_link_target(file) == target for file in (process / "fd").iterdir())
    except FileNotFoundError:  # it has ended
        return False
    except PermissionError:
        # The process of another user.
        return None


def _link_target(file: Path) -> str | None:
    try:
        return str(file.readlink())
    except FileNotFoundError:  # closed meanwhile
        return None


def _stable_names(folder: Path) -> dict[str, str]:
    if not folder.is_dir():
        return {}
    # Sorted, so that of several names of one port the same one is found each time.
    return {final_name(link): str(link) for link in sorted(folder.iterdir())}
