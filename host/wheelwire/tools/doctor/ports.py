"""Checks of serial ports: who may open them, which programs take them, and their names."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

from ...connect import ENVIRONMENT
from .finding import Finding
from .machine import Adapter, Machine, Node, users_of

_LIDAR = (0x10C4, 0xEA60)
_BY_NUMBER = re.compile(r"/dev/tty(USB|ACM)\d+")
_RULES = ("/etc/udev/rules.d", "/run/udev/rules.d", "/usr/lib/udev/rules.d", "/lib/udev/rules.d")
_PRODUCT = re.compile(r'ENV\{PRODUCT\}=="([^"]+)"')
_ATTRIBUTE = re.compile(r'ATTRS\{(manufacturer|product)\}=="([^"]*)"')
_MM_IGNORES = re.compile(r"E:ID_MM_(PORT|DEVICE)_IGNORE=1|E:ID_MM_CANDIDATE=0")
_MM_OLD_POLICIES = ("--filter-policy=default", "--filter-policy=legacy")
_AT_COMMANDS = "01"
_NAMES = "give each socket a name by a udev rule (docs/ros.md#names-for-the-ports), and use it"


def permission(machine: Machine) -> Iterator[Finding]:
    """Who may open the ports."""
    groups = set()
    for port in (port for adapter in machine.adapters for port in adapter.ports):
        node = machine.device(port)
        # One cure opens all ports of a group.
        if node is not None and not node.accessible and node.group not in groups:
            groups.add(node.group)
            yield _forbidden(machine, port, node)


def _forbidden(machine: Machine, port: str, node: Node) -> Finding:
    groups = _groups(machine)
    group = next((name for name, (id_, _) in groups.items() if id_ == node.group), "")
    user = _user(machine)
    if not node.group_may:
        return Finding(
            "port-permission",
            f"/dev/{port} may be opened by root alone.",
            "install a udev rule with GROUP and MODE: docs/ros.md#names-for-the-ports",
        )
    if machine.in_container:
        return Finding(
            "port-permission",
            f"/dev/{port} is of group {node.group}, which this container's user is not in.",
            f"start the container with --group-add {node.group}",
        )
    if user in groups.get(group, (0, ()))[1]:
        return Finding(
            "session",
            f"{user} is in the group {group}, but this session began before that.",
            "log out and in again, or restart the computer; until then: "
            f"sg {group} -c 'wheelwire info /dev/{port}'",
        )
    return Finding(
        "port-permission",
        f"{user or 'this user'} may not open /dev/{port}, which is of the group "
        f"{group or node.group}.",
        f"sudo usermod -aG {group or node.group} {user or '$USER'}, then log out and in again",
    )


def _groups(machine: Machine) -> dict[str, tuple[int, tuple[str, ...]]]:
    """Id and members of each group."""
    found = {}
    for line in machine.read("/etc/group").splitlines():
        name, _, number, members = (line.split(":") + [""] * 4)[:4]
        if number.isdigit():
            found[name] = (int(number), tuple(filter(None, members.split(","))))
    return found


def _user(machine: Machine) -> str:
    match = re.search(r"^Uid:\s+(\d+)", machine.read("/proc/self/status"), re.M)
    for line in machine.read("/etc/passwd").splitlines():
        name, _, number = (line.split(":") + [""] * 3)[:3]
        if match and number == match[1]:
            return name
    return ""


def brltty(machine: Machine) -> Iterator[Finding]:
    """The Braille daemon takes USB chips that some Braille displays have, too."""
    service = machine.path("/etc/systemd/system/brltty-udev.service")
    if service.is_symlink() and str(service.readlink()) == "/dev/null":  # it is masked
        return
    for adapter in machine.adapters:
        if _brltty_takes(machine, adapter):
            yield Finding(
                "brltty",
                f"brltty's udev rules take {adapter.label} for a Braille display, and its port "
                "vanishes.",
                "sudo apt remove brltty, then plug it in again",
            )


def _brltty_takes(machine: Machine, adapter: Adapter) -> bool:
    product = f"{adapter.vendor_id:x}/{adapter.product_id:x}/0"
    for rule in _rules(machine, "*brltty*.rules"):
        ids = _PRODUCT.search(rule)
        if (
            ids
            and fnmatchcase(product, ids[1])
            and all(
                fnmatchcase(machine.read(adapter.folder / name), wanted)
                for name, wanted in _ATTRIBUTE.findall(rule)
            )
        ):
            return True
    return False


def _rules(machine: Machine, pattern: str) -> Iterator[str]:
    """The lines of udev rules that count: a file hides those of its name in later folders."""
    files: dict[str, Path] = {}
    for folder in _RULES:
        for file in machine.files(folder, pattern):
            files.setdefault(file.name, file)
    for file in files.values():
        lines = machine.read(file).splitlines()
        yield from (line for line in lines if not line.lstrip().startswith("#"))


def modem_manager(machine: Machine) -> Iterator[Finding]:
    """ModemManager sends modem commands to ports that may be a modem's."""
    running = [p for p in machine.processes if p.program == "ModemManager"]
    if not running:
        return
    tries_all = any(a in _MM_OLD_POLICIES for p in running for a in p.arguments)
    for adapter in machine.adapters:
        for port in adapter.ports:
            if (tries_all or _says_modem(machine, port)) and not _mm_ignores(machine, port):
                yield Finding(
                    "modemmanager",
                    f"ModemManager tries /dev/{port} as a modem for some seconds after each "
                    "plugging.",
                    "sudo systemctl disable --now ModemManager; or set ID_MM_PORT_IGNORE by a udev "
                    "rule (docs/ros.md#names-for-the-ports)",
                )


def _says_modem(machine: Machine, port: str) -> bool:
    interface = machine.folder_above(port, "bInterfaceNumber")
    return (
        port.startswith("ttyACM")
        and interface is not None
        and machine.read(interface / "bInterfaceProtocol") == _AT_COMMANDS
    )


def _mm_ignores(machine: Machine, port: str) -> bool:
    known = machine.udev_data(machine.path(f"/sys/class/tty/{port}"))
    if folder := machine.usb_folder(port):
        known += machine.udev_data(folder)
    return any(_MM_IGNORES.match(line) for line in known)


def latency_timer(machine: Machine) -> Iterator[Finding]:
    """FTDI's chips delay bytes, unless the program that has the port asked for low latency."""
    for port in (port for adapter in machine.adapters for port in adapter.ports):
        timer = machine.read(f"/sys/bus/usb-serial/devices/{port}/latency_timer")
        if not timer.isdigit() or int(timer) <= 1:
            continue
        # Harmless while no program has the port open: Wheelwire asks for it when it opens one.
        user = next(users_of(machine, f"/dev/{port}"), None)
        if user is not None:
            yield Finding(
                "latency-timer",
                f"/dev/{port}, which {user.program} uses, holds bytes back for up to {timer} ms.",
                f"echo 1 | sudo tee /sys/bus/usb-serial/devices/{port}/latency_timer",
            )


def names(machine: Machine) -> Iterator[Finding]:
    """Ports whose names do not last."""
    adapters = [adapter for adapter in machine.adapters if adapter.ports]
    robot = machine.robot or machine.environment.get(ENVIRONMENT, "")
    alike = defaultdict(list)
    for adapter in adapters:
        if not _has_own_name(machine, adapter):
            alike[adapter.ids, adapter.serial_number].append(adapter)
    twins = [group for group in alike.values() if len(group) > 1]
    for group in twins:
        serial = group[0].serial_number
        yield Finding(
            "same-serial",
            f"{' and '.join(a.label for a in group)} have the same ids {group[0].ids} and "
            f"{f'the same serial number {serial}' if serial else 'no serial number'}: nothing but "
            "their sockets tells them apart.",
            _NAMES,
        )
    if not twins:
        yield from _robots_name(machine, robot, adapters)


def _has_own_name(machine: Machine, adapter: Adapter) -> bool:
    """Whether a udev rule of this computer names it; systemd's own links are below serial/."""
    return any(
        line.startswith("S:") and not line.startswith("S:serial/")
        for port in adapter.ports
        for line in machine.udev_data(machine.path(f"/sys/class/tty/{port}"))
    )


def _robots_name(machine: Machine, robot: str, adapters: list[Adapter]) -> Iterator[Finding]:
    if _BY_NUMBER.fullmatch(robot):
        others = [a for a in adapters if Path(robot).name not in a.ports]
        lidars = [a for a in others if (a.vendor_id, a.product_id) == _LIDAR]
        if lidars:
            yield Finding(
                "lidar",
                f"{robot} is named by its number, which changes, and {lidars[0].label} has the "
                "chip of RPLidars: the robot's program may open the lidar, and stop its motor.",
                _NAMES,
            )
    elif (
        robot.startswith("/dev/")
        and adapters
        and machine.device(robot.removeprefix("/dev/")) is None
    ):
        yield Finding(
            "udev-rule",
            f"{robot} is missing, although {adapters[0].label} is there: no udev rule makes "
            "this name for it.",
            "write the socket into the udev rule and reload the rules: "
            "docs/ros.md#names-for-the-ports",
        )


def autosuspend(machine: Machine) -> Iterator[Finding]:
    """USB devices that the kernel may put to sleep."""
    for adapter in machine.adapters:
        if adapter.ports and machine.read(adapter.folder / "power/control") == "auto":
            yield Finding(
                "autosuspend",
                f"the kernel may put {adapter.label} to sleep while it is idle.",
                f"echo on | sudo tee /sys/bus/usb/devices/{adapter.socket}/power/control; for good:"
                f" USB_DENYLIST={adapter.ids} in /etc/tlp.conf, or a udev rule",
            )


def no_port(machine: Machine) -> Iterator[Finding]:
    """A board that is plugged in, but has no port here."""
    adapters = machine.adapters
    if machine.in_container:
        missing = [
            port for adapter in adapters for port in adapter.ports if machine.device(port) is None
        ]
        if missing:
            yield Finding(
                "container",
                f"the kernel has {', '.join(missing)}, but this container has no such device.",
                f"start the container with --device /dev/{missing[0]} (docs/ros.md#with-docker)",
            )
    elif machine.in_wsl and not adapters:
        yield Finding(
            "wsl",
            "this is WSL, and no USB serial port is attached to it.",
            "in PowerShell: usbipd list, usbipd bind --busid ID, usbipd attach --wsl --busid ID",
        )
    for adapter in adapters:
        if not adapter.ports and not _brltty_takes(machine, adapter):
            yield Finding(
                "no-driver",
                f"{adapter.label} is a serial adapter, but the kernel made no port for it.",
                "sudo modprobe -a cp210x ch341 ftdi_sio cdc_acm; if they are missing: sudo apt "
                "install linux-modules-extra-$(uname -r), on WSL wsl --update",
            )


CHECKS = (permission, brltty, modem_manager, latency_timer, names, autosuspend, no_port)
