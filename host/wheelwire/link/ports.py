"""The serial ports of this computer, and the names that programs use for a port.

This opens no port: opening asserts DTR, which stops a lidar's motor and may reset a board.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from ..errors import InvalidArgument, meant

PSEUDO_TERMINALS = "/dev/pts/"
"""Folder of the pseudo-terminals; each has a program at its other end, not a device."""

BRIDGES = {
    (0x10C4, 0xEA60): "CP210x: an ESP32 board, or an RPLidar (same ids); identify by handshake",
    (0x1A86, 0x7523): "CH340: an ESP32 board, or an Arduino clone",
    (0x1A86, 0x55D4): "CH9102: an ESP32 board",
    (0x0403, 0x6001): "FT232: an ESP32 board, or any serial adapter",
    (0x0403, 0x6010): "FT2232: an ESP32 board with a debugger, or any serial adapter",
    (0x0403, 0x6015): "FT231X: an ESP32 board, or any serial adapter",
    (0x303A, 0x1001): "native USB of an ESP32-S3, -C3 or -C6",
}


class SerialPort(NamedTuple):
    """One serial port.

    Attributes:
        device: Such as `/dev/ttyUSB0`; may change at the next plugging.
        by_path: A name that stays with the USB socket; None when the system gives none.
        description: The system's.
        vendor_id: None unless it is a USB port.
        product_id: None unless it is a USB port.
        serial_number: Many bridges have none, or all the same.
        likely_esp32: The bridge is one that ESP32 boards have.
        note: What the bridge may belong to; empty when it is not known.
        in_use: Some process has it open; None: only root could see that.
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
    from serial.tools import list_ports  # here, for most programs name their port

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
    # One process that has it open settles it, even if others cannot be inspected.
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
    """Where links to a device lead; its own name if a link vanishes because it was unplugged."""
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
    except FileNotFoundError:  # just closed
        return None


def _stable_names(folder: Path) -> dict[str, str]:
    if not folder.is_dir():
        return {}
    # Sorted, so that a port with several names always gets the same one.
    return {final_name(link): str(link) for link in sorted(folder.iterdir())}


# --- the names of a port --------------------------------------------------------------------------

UNIX = "unix:"
_LOCAL = ("localhost", "ip6-localhost", "::1")
_KINDS = {kind.lower(): kind for kind in ("USB", "ACM", "AMA", "S")}
_SERIAL = re.compile(r"(?:/dev/)?tty(usb|acm|ama|s)(\d+)", re.IGNORECASE)


def port_name(port: str) -> str:
    """A port's name that stays right when the program changes its folder; opens nothing.

    Links stay as they are: where they lead may change when the board is plugged in again.

    Raises:
        InvalidArgument: It begins with `~`, and there is no home folder.
    """
    scheme, path = _parts(port)
    if not path or "://" in path or "*" in path or "," in path:
        return port
    try:
        found = Path(path).expanduser()
    except RuntimeError as error:
        raise InvalidArgument(f"{port}: there is no home folder (HOME): write all of it") from error
    if scheme or path.startswith("~") or (not found.is_absolute() and _is_device(found)):
        return f"{scheme}{found.absolute()}"
    return port


def device_of(port: str) -> str:
    """One name for all names of a port, a socket or a Unix socket: what they lead to.

    The names of drivers are their own.
    """
    scheme, path = _parts(port)
    if "://" in path:
        return _url(path)
    if scheme or "/" in path or _is_device(Path(path)):
        try:
            return f"{scheme}{Path(path).resolve()}"
        except OSError:  # the link has vanished: it was unplugged
            return port
    return port


def meant_port(port: str) -> str:
    """A question with the port that a wrong name may mean, or nothing."""
    if found := re.fullmatch(r"COM(\d+)", port, re.IGNORECASE):
        return (
            f"{port} is a name of Windows; did you mean /dev/ttyUSB0? In WSL the adapter has to be "
            "attached first (`wheelwire help wsl`)"
        )
    if found := _SERIAL.fullmatch(port):
        name = f"/dev/tty{_KINDS[found[1].lower()]}{found[2]}"
        return f"did you mean {name}?" if name != port else ""
    if port and "/" not in port and _is_device(device := Path("/dev", port)):
        return f"did you mean {device}?"
    if meant(Path(port).suffix, [".mcap"], cutoff=0.7):
        return "a recording's name ends in .mcap"
    return ""


def _parts(port: str) -> tuple[str, str]:
    """`unix:`, if it begins so, and the rest."""
    return (UNIX, port.removeprefix(UNIX)) if port.startswith(UNIX) else ("", port)


def _is_device(path: Path) -> bool:
    try:
        return path.is_char_device() or path.is_socket()
    except (OSError, ValueError):
        return False


def _url(url: str) -> str:
    from urllib.parse import urlsplit  # here, for most ports are devices

    try:
        parts = urlsplit(url)
        host = parts.hostname or ""
        port = f":{parts.port}" if parts.port is not None else ""
    except ValueError:
        return url
    host = "127.0.0.1" if host in _LOCAL else host
    return f"{parts.scheme}://{host}{port}{parts.path.rstrip('/')}"
