"""The computer that the doctor examines, by its files, its environment and a few commands."""

from __future__ import annotations

import os
import platform
import stat
import struct
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path

from ...link.ports import BRIDGES

COMMAND_TIMEOUT_S = 5.0
_PORTS = ("ttyUSB*", "ttyACM*")


@dataclass(frozen=True)
class Node:
    """A device file.

    Attributes:
        group: The id of its group.
        group_may: Its group may read and write it.
        accessible: This process may, for any reason.
    """

    group: int
    group_may: bool
    accessible: bool


@dataclass(frozen=True)
class Process:
    """A running process, as far as it can be seen."""

    pid: int
    arguments: tuple[str, ...]

    @property
    def program(self) -> str:
        """The name of its file."""
        return Path(self.arguments[0]).name if self.arguments else ""


@dataclass(frozen=True)
class Adapter:
    """A USB device with a serial port, or one that should have one.

    Attributes:
        socket: Where it is plugged in, such as `1-1.2`.
        folder: Its folder in /sys.
        ports: Names, such as `ttyUSB0`; none while no driver has made one.
    """

    socket: str
    folder: Path
    vendor_id: int
    product_id: int
    serial_number: str
    ports: tuple[str, ...]

    @property
    def label(self) -> str:
        """Its name in messages."""
        where = ", ".join(f"/dev/{port}" for port in self.ports)
        return where or f"the USB device {self.ids} at socket {self.socket}"

    @property
    def ids(self) -> str:
        """As `lsusb` shows them."""
        return f"{self.vendor_id:04x}:{self.product_id:04x}"


def command_output(command: Sequence[str]) -> str:
    """What a command prints; nothing when it is missing, fails or takes too long."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=COMMAND_TIMEOUT_S, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout


def import_error(module: str) -> str:
    """Why a module cannot be imported; empty if it can."""
    try:
        import_module(module)
    except Exception as error:  # a broken extension may raise anything
        lines = [line for line in str(error).splitlines() if line.strip()]
        return lines[-1] if lines else type(error).__name__
    return ""


def node_of(path: Path) -> Node | None:
    """A device file, or None."""
    try:
        found = path.stat()
    except OSError:
        return None
    may = stat.S_IRGRP | stat.S_IWGRP
    # `access` counts what the mode does not show: root, and the access lists of systemd's logind.
    return Node(
        group=found.st_gid,
        group_may=found.st_mode & may == may,
        accessible=os.access(path, os.R_OK | os.W_OK),
    )


@dataclass(frozen=True)
class Machine:
    """A computer.

    Args:
        root: In place of /, for tests.
        environment: Environment of this process.
        robot: The address of the robot that was named; empty: none was.
        architecture: As `uname -m`.
        bits: Size of Python's pointers: 32 on a 64-bit kernel, too.
        run: A command to what it prints, empty when it fails.
        import_error: A module's name to why it cannot be imported, empty if it can.
        node: A device file's path to what is there.
    """

    root: Path = Path("/")
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ)
    robot: str = ""
    architecture: str = field(default_factory=platform.machine)
    bits: int = 8 * struct.calcsize("P")
    run: Callable[[Sequence[str]], str] = command_output
    import_error: Callable[[str], str] = import_error
    node: Callable[[Path], Node | None] = node_of

    def path(self, absolute: str) -> Path:
        """Where a path is found below `root`."""
        return self.root / absolute.lstrip("/")

    def read(self, absolute: str | Path) -> str:
        """A file's text, without white space around it; empty when it cannot be read."""
        path = self.path(absolute) if isinstance(absolute, str) else absolute
        with suppress(OSError):
            return path.read_bytes().decode("utf-8", "replace").strip("\0 \t\r\n")
        return ""

    def files(self, folder: str, pattern: str) -> list[Path]:
        """What in a folder has a name of this pattern, in order."""
        with suppress(OSError):
            return sorted(self.path(folder).glob(pattern))
        return []

    def device(self, name: str) -> Node | None:
        """A file of /dev."""
        return self.node(self.path(f"/dev/{name}"))

    @property
    def in_container(self) -> bool:
        """Whether Docker or Podman made what this process sees."""
        return any(self.path(name).exists() for name in ("/.dockerenv", "/run/.containerenv"))

    @property
    def in_wsl(self) -> bool:
        """Whether this is Linux under Windows."""
        return "microsoft" in self.read("/proc/version").lower()

    @property
    def pi_model(self) -> str:
        """Such as `Raspberry Pi 4 Model B Rev 1.4`; empty elsewhere."""
        model = self.read("/proc/device-tree/model")
        return model if model.startswith("Raspberry Pi") else ""

    @cached_property
    def processes(self) -> list[Process]:
        """The running processes. Kernel threads have no arguments and are left out."""
        return [
            Process(int(folder.name), tuple(line.split("\0")))
            for folder in self.files("/proc", "[0-9]*")
            if (line := self.read(folder / "cmdline"))
        ]

    def environment_of(self, process: Process) -> dict[str, str]:
        """The environment that a process was started with; empty when it is another user's."""
        pairs = self.read(f"/proc/{process.pid}/environ").split("\0")
        return dict(pair.split("=", 1) for pair in pairs if "=" in pair)

    @cached_property
    def adapters(self) -> list[Adapter]:
        """The USB serial adapters, by name of port; last those of a known chip without a port."""
        ports: dict[Path, list[str]] = {}
        for pattern in _PORTS:
            for tty in self.files("/sys/class/tty", pattern):
                if folder := self.usb_folder(tty.name):
                    ports.setdefault(folder, []).append(tty.name)
        folders = dict.fromkeys(ports)
        for device in self.files("/sys/bus/usb/devices", "*-*"):
            ids = self._ids(device)
            if ids in BRIDGES:
                folders.setdefault(device.resolve())
        return [self._adapter(folder, ports.get(folder, [])) for folder in folders]

    def usb_folder(self, port: str) -> Path | None:
        """The folder in /sys of a port's USB device; None if it is not a USB port."""
        return self.folder_above(port, "idVendor")

    def folder_above(self, port: str, file: str) -> Path | None:
        """The nearest folder of /sys above a port's device that has this file; None if none has."""
        with suppress(OSError):
            start = self.path(f"/sys/class/tty/{port}/device").resolve()
            return next((p for p in (start, *start.parents) if (p / file).exists()), None)
        return None

    def udev_data(self, folder: Path) -> list[str]:
        """What udev knows of a device, by its folder of /sys: lines such as `S:wheelwire`."""
        kind = "b" if "block" in folder.parts else "c"
        return self.read(f"/run/udev/data/{kind}{self.read(folder / 'dev')}").splitlines()

    def _ids(self, folder: Path) -> tuple[int, int]:
        with suppress(ValueError):
            vendor, product = (self.read(folder / name) for name in ("idVendor", "idProduct"))
            return int(vendor, 16), int(product, 16)
        return 0, 0  # an interface

    def _adapter(self, folder: Path, ports: list[str]) -> Adapter:
        vendor_id, product_id = self._ids(folder)
        serial = self.read(folder / "serial")
        return Adapter(folder.name, folder, vendor_id, product_id, serial, tuple(ports))


def users_of(machine: Machine, device: str) -> Iterator[Process]:
    """The processes that have a device file open, as far as this user may see."""
    target = str(machine.path(device))
    for process in machine.processes:
        with suppress(OSError):
            for link in machine.path(f"/proc/{process.pid}/fd").iterdir():
                if str(link.readlink()) in (device, target):
                    yield process
                    break
