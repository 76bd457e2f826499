"""Checks of the computer itself: supply, speed, clock, pins, packages."""

from __future__ import annotations

from collections.abc import Iterator

from .finding import Finding
from .machine import Machine, Process

_THROTTLED = "/sys/devices/platform/soc/soc:firmware/get_throttled"
_UNDER_VOLTAGE_NOW, _UNDER_VOLTAGE_BEFORE = 1 << 0, 1 << 16
_HOT = 1 << 3 | 1 << 19
_SELF_DRIVEN = ("intel_pstate", "amd-pstate", "amd-pstate-epp")
"""Drivers whose governor `powersave` still raises the clock under load."""
_PIGPIOD_PORT = 8888
_LISTENS = "0A"
_FACTORY_MODULES = {"lgpio": "lgpio", "rpigpio": "RPi", "pigpio": "pigpio"}
_RECORD = "WHEELWIRE_RECORD"


def under_voltage(machine: Machine) -> Iterator[Finding]:
    """What a Raspberry Pi says of its supply and its temperature."""
    flags = _throttled(machine)
    alarm = any(
        machine.read(chip / "name") == "rpi_volt" and machine.read(chip / "in0_lcrit_alarm") == "1"
        for chip in machine.files("/sys/class/hwmon", "hwmon*")
    )
    if flags & (_UNDER_VOLTAGE_NOW | _UNDER_VOLTAGE_BEFORE) or alarm:
        now = flags & _UNDER_VOLTAGE_NOW or alarm
        yield Finding(
            "under-voltage",
            f"the Pi's supply {'is too low now' if now else 'was too low since it started'}: it "
            "slows down, and USB devices drop out.",
            "give the Pi a supply of its own with 5.1 V and a short cable, apart from the motors'",
        )
    if flags & _HOT:
        yield Finding(
            "hot",
            "the Pi reached its temperature limit and slowed down.",
            "fit a heat sink or a fan; vcgencmd measure_temp shows the temperature",
        )


def _throttled(machine: Machine) -> int:
    """The flags of `vcgencmd get_throttled`; 0 without them."""
    text = machine.read(_THROTTLED)
    if not text and machine.pi_model:
        text = machine.run(["vcgencmd", "get_throttled"]).strip().partition("=0x")[2]
    try:
        return int(text or "0", 16)
    except ValueError:
        return 0


def governor(machine: Machine) -> Iterator[Finding]:
    """A processor that stays at its lowest clock."""
    for cpu in machine.files("/sys/devices/system/cpu", "cpu[0-9]*"):
        frequency = cpu / "cpufreq"
        if (
            machine.read(frequency / "scaling_governor") == "powersave"
            and machine.read(frequency / "scaling_driver") not in _SELF_DRIVEN
        ):
            yield Finding(
                "governor",
                "the processor stays at its lowest clock: its governor is powersave.",
                "echo ondemand | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
            )
            return


def clock(machine: Machine) -> Iterator[Finding]:
    """A clock that no time server sets."""
    said = machine.run(["timedatectl", "show", "--property=NTP", "--property=NTPSynchronized"])
    lines = said.splitlines()
    if "NTPSynchronized=no" not in lines:
        return
    is_on = "NTP=yes" in lines
    yield Finding(
        "clock",
        "the clock is not synchronised: stamps of several computers, and of recordings, do not "
        "fit together.",
        "check the network, then timedatectl timesync-status"
        if is_on
        else "sudo timedatectl set-ntp true; if there is no NTP service: sudo apt install chrony",
    )


def pigpiod(machine: Machine) -> Iterator[Finding]:
    """A pigpiod that lets the whole network move the pins."""
    for process in machine.processes:
        if process.program == "pigpiod" and _port(process) in _open_to_all(machine):
            yield Finding(
                "pigpiod",
                f"pigpiod listens on all interfaces, port {_port(process)}: everyone in the "
                "network can move the pins.",
                "start it with -l (docs/pi-pins.md#pigpiod-started-by-systemd)",
            )


def _port(process: Process) -> int:
    """The port that pigpiod was started with: `-p 8887` or `-p8887`."""
    arguments = process.arguments
    for option, value in zip(arguments, (*arguments[1:], ""), strict=True):
        if option.startswith("-p"):
            number = option[2:] or value
            return int(number) if number.isdigit() else _PIGPIOD_PORT
    return _PIGPIOD_PORT


def _open_to_all(machine: Machine) -> set[int]:
    """The TCP ports that listen on all interfaces."""
    found = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in machine.read(table).splitlines()[1:]:
            fields = line.split()
            address, _, port = fields[1].partition(":")
            if fields[3] == _LISTENS and not address.strip("0"):
                found.add(int(port, 16))
    return found


def pin_factory(machine: Machine) -> Iterator[Finding]:
    """A Pi with gpiozero, but nothing that moves its pins."""
    if not machine.pi_model or machine.import_error("gpiozero"):
        return
    chosen = machine.environment.get("GPIOZERO_PIN_FACTORY", "lgpio")
    module = _FACTORY_MODULES.get(chosen)
    if module and (error := machine.import_error(module)):
        yield Finding(
            "pin-factory",
            f"gpiozero has no pin factory on this {machine.pi_model}: {chosen} cannot be "
            f"imported ({error}).",
            "pip install 'wheelwire[pi]', and unset GPIOZERO_PIN_FACTORY",
        )


def wheels(machine: Machine) -> Iterator[Finding]:
    """Packages that PyPI has no wheels of for 32-bit ARM."""
    if machine.bits > 32 or not machine.architecture.startswith(("arm", "aarch64")):
        return
    needed = ["numpy"]
    if machine.environment.get(_RECORD) or not machine.import_error("mcap"):
        needed += ["mcap", "lz4.frame", "zstandard"]
    for module in needed:
        if error := machine.import_error(module):
            package = module.partition(".")[0]
            yield Finding(
                "wheels",
                f"{package} cannot be imported on this 32-bit system ({error}).",
                "install a 64-bit Raspberry Pi OS; or sudo apt install libopenblas0 "
                f"python3-{package}, and use piwheels",
            )


CHECKS = (under_voltage, governor, clock, pigpiod, pin_factory, wheels)
