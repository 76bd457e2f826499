"""The firmware's core on RV32: built with Debian's compiler, run and counted in QEMU."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from .processes import captured

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build" / "rv32"
COMPILER = "riscv64-unknown-elf-gcc"
QEMU = "qemu-system-riscv32"
INSTALL = "sudo apt install gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf qemu-system-misc"

AIM_INSTRUCTIONS = 7000
"""Limit of a control step that takes a setpoint and sends a state."""

AIM_RECORDED_INSTRUCTIONS = 8000
"""Limit of the same step when the black box records it, which gets another twelfth of the
millisecond of a core at 160 MHz."""

AIM_HOLD_INSTRUCTIONS = 6000
"""Limit of a step that says what holds the robot, once a second, and takes a setpoint at most."""

AIM_SEGMENT_INSTRUCTIONS = 16_000
"""Limit of a recorded step that begins a segment, about every half second. It writes the
state of the core, some 320 words, and takes a tenth of a millisecond of such a core."""

AIM_RECORDER_BYTES = 12 * 1024
"""Code of the recorder, which the core does not need."""

AIM_RECORDED_GROWTH = 0.10
"""Growth of the median step, against the baseline."""

AIM_CODE_BYTES = 66 * 1024
"""Of core and sensors: the core checks what the drivers in the other library use."""
AIM_RAM_BYTES = 4 * 1024


class Instructions(NamedTuple):
    """The instruction counts of one kind of work."""

    runs: int
    median: int
    max: int


class Cost(NamedTuple):
    """Sizes of the core at -Os.

    `code_bytes` is code and constants, a template's copy in each of two objects counted twice.
    `ram_bytes` is static data, the robot and its two bridges, without the stack.
    """

    instructions: dict[str, Instructions]
    code_bytes: int
    ram_bytes: int


def available() -> bool:
    """Whether compiler, C library and machine are installed."""
    if not (shutil.which(COMPILER) and shutil.which(QEMU)):
        return False
    specs = _output(COMPILER, "-print-file-name=picolibc.specs").strip()
    return Path(specs).is_absolute()


def compiler_version() -> str:
    """The compiler's version; counts are comparable only if it is the same."""
    return _output(COMPILER, "-dumpfullversion").strip()


def build() -> None:
    """Build the core and its two programs."""
    _output("make", "-C", str(ROOT), "--no-print-directory", "rv32")


def run(program: str) -> str:
    """Run a program to its end and return what it printed.

    Raises:
        AssertionError: Its exit status was not 0.
    """
    machine = f"{QEMU} -M virt -bios none -display none -serial none -monitor none"
    # One instruction a nanosecond of the machine's own time: the counter counts exactly.
    counting = "-icount shift=0"
    printing = "-chardev stdio,id=out -semihosting-config enable=on,chardev=out"
    image = str(BUILD / f"{program}.elf")
    return _output(*f"{machine} {counting} {printing}".split(), "-kernel", image)


def cost() -> Cost:
    """Run the benchmark and measure the libraries."""
    counted, device_bytes = _counted("cost")
    del counted["step_with_hold"]
    core, sensors = map(_sizes, ("core", "sensors"))
    return Cost(counted, code_bytes=core[0] + sensors[0], ram_bytes=sum(core[1:]) + device_bytes)


def hold() -> Instructions:
    """The steps of the benchmark that say what holds the robot."""
    return _counted("cost")[0]["step_with_hold"]


def recorded() -> dict[str, Instructions]:
    """Run the benchmark with the black box."""
    return _counted("recorded")[0]


def recorder_bytes() -> int:
    """Code and constants of the recorder, at -Os."""
    return _sizes("recorder")[0]


def _counted(program: str) -> tuple[dict[str, Instructions], int]:
    """What a benchmark counts, and the bytes of its device."""
    counted = json.loads(run(program))
    device_bytes = counted.pop("device_bytes")
    return {name: Instructions(**counts) for name, counts in counted.items()}, device_bytes


def _sizes(library: str) -> tuple[int, int, int]:
    """Bytes of code, of data and of zeros in one of the libraries."""
    totals = _output("riscv64-unknown-elf-size", "-t", str(BUILD / f"libwheelwire_{library}.a"))
    code, data, bss = (int(column) for column in totals.splitlines()[-1].split()[:3])
    return code, data, bss


def _output(*command: str) -> str:
    result = captured(*command, stdin=subprocess.DEVNULL, timeout=250)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout
