"""Builds and tests the wheels: `make wheels`, `make wheels-check`, `make wheel-check`.

A wheel holds the core's library and `wheelwire-fwsim`. A release's are compiled by zig against the
oldest glibc that they are to run on; the one of this computer by its own compiler.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import venv
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "firmware" / "esp32" / "sim"
DIST = ROOT / "build" / "dist"
NATIVE = "native"
SOURCE_DISTRIBUTION = "sdist"
TIMEOUT_S = 60.0
TRIES = 5
"""Retries: on a busy computer a setpoint may expire before it is sent."""
TESTS = ("wheelwire-core-test", "wheelwire-sim-test", "wheelwire-capi-test")


class Target(NamedTuple):
    """A processor, and its names elsewhere."""

    processor: str
    """As pip calls it."""
    triple: str
    """As zig and Debian call it."""
    cpu: str = ""
    """The oldest one, as zig calls it."""
    other_tag: str = ""
    """Another that pip selects its wheel by."""

    @property
    def zig(self) -> str:
        """What zig compiles for."""
        return f"{self.triple}.2.17"

    @property
    def tags(self) -> str:
        """What pip selects its wheel by."""
        return f"manylinux_2_17_{self.processor}.manylinux2014_{self.processor}{self.other_tag}"

    @property
    def emulator(self) -> list[str]:
        """A program of Debian's qemu-user-static, with the directory of libc6-...-cross."""
        return [f"qemu-{self.triple.partition('-')[0]}-static", "-L", f"/usr/{self.triple}"]


TARGETS = {
    target.processor: target
    for target in (
        Target("x86_64", "x86_64-linux-gnu"),
        Target("aarch64", "aarch64-linux-gnu"),
        # Also runs on the first Raspberry Pi, where pip accepts no manylinux tag.
        Target("armv7l", "arm-linux-gnueabihf", "arm1176jzf_s", ".linux_armv6l"),
    )
}


# --- building ------------------------------------------------------------------------------------


def build(name: str) -> None:
    """Build one wheel, or the source distribution, in build/dist."""
    if name == SOURCE_DISTRIBUTION:
        from scikit_build_core.build import build_sdist

        DIST.mkdir(parents=True, exist_ok=True)
        print(build_sdist(str(DIST)))
        return
    if name == NATIVE:
        _pip_wheel(os.environ)
        return
    target = TARGETS[name]
    wheel = _pip_wheel(
        zig_environment(target) | {"_PYTHON_HOST_PLATFORM": f"linux-{target.processor}"},
        "--config-settings",
        f"cmake.define.CMAKE_TOOLCHAIN_FILE={SOURCE / 'zig.cmake'}",
        "--config-settings",
        f"build-dir=build/wheel/zig-{target.processor}",
    )
    command = [sys.executable, "-m", "wheel", "tags", "--remove", "--platform-tag", target.tags]
    subprocess.run([*command, str(wheel)], check=True)


def zig_environment(target: Target) -> dict[str, str]:
    """The environment that firmware/esp32/sim/zig.cmake reads."""
    import ziglang

    return {
        **{name: value for name, value in os.environ.items() if "_COMPILER_LAUNCHER" not in name},
        "WHEELWIRE_ZIG": str(Path(ziglang.__file__).parent),
        "WHEELWIRE_ZIG_TARGET": target.zig,
        "WHEELWIRE_ZIG_CPU": target.cpu,
    }


def _pip_wheel(environment: os._Environ[str] | dict[str, str], *options: str) -> Path:
    new = DIST / "new"
    new.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check"]
    command += ["--no-deps", "--no-build-isolation", "--wheel-dir", str(new), *options, str(ROOT)]
    subprocess.run(command, env=environment, check=True)
    (wheel,) = new.glob("*.whl")
    print(f"{wheel.name}: {wheel.stat().st_size / 1000:.0f} kB")
    return wheel.replace(DIST / wheel.name)


# --- testing -------------------------------------------------------------------------------------


def check(name: str) -> None:
    """Test one wheel of build/dist."""
    platform = f"-linux_{os.uname().machine}" if name == NATIVE else f"2014_{name}"
    (wheel,) = DIST.glob(f"*{platform}*.whl")
    folder = ROOT / "build" / "wheel-check" / name
    if name == NATIVE or name == os.uname().machine:
        _check_installed(wheel, folder)
    else:
        _check_emulated(wheel, folder, TARGETS[name])


def _check_installed(wheel: Path, folder: Path) -> None:
    """Test it in a fresh environment with an empty PATH."""
    venv.create(folder, clear=True, with_pip=True)
    python = str(folder / "bin" / "python")
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, str(wheel)], check=True)
    script = (
        "from wheelwire_protocol import decoder, native\n"
        "assert decoder.Decoder is decoder.NativeDecoder\n"
        "print('the library is', native.library_path())"
    )
    nothing = {"PATH": ""}
    subprocess.run([python, "-c", script], env=nothing, cwd=folder, check=True)
    command = str(folder / "bin" / "wheelwire")
    for page in ("troubleshooting/port", "tutorial/1-parts", "messages/parameters"):
        subprocess.run([command, "help", page], env=nothing, stdout=subprocess.DEVNULL, check=True)
    _drive(command, folder, nothing)


def _check_emulated(wheel: Path, folder: Path, target: Target) -> None:
    """Run the C++ tests with the wheel's library, and drive its simulator."""
    folder.mkdir(parents=True, exist_ok=True)
    with ZipFile(wheel) as archive:
        archive.extractall(folder)
    library = folder / "wheelwire_protocol"
    emulate = [*target.emulator, "-E", f"LD_LIBRARY_PATH={library}"]
    tests = folder / "tests"
    configure = ["cmake", "-S", str(SOURCE), "-B", str(tests), "-G", "Ninja"]
    configure += [f"-DCMAKE_TOOLCHAIN_FILE={SOURCE / 'zig.cmake'}", "-DCMAKE_BUILD_TYPE=Release"]
    for command in (configure, ["cmake", "--build", str(tests), "--target", *TESTS]):
        built = subprocess.run(command, env=zig_environment(target), capture_output=True, text=True)
        if built.returncode:
            sys.exit(f"{target.processor}: no C++ tests\n{built.stdout}{built.stderr}")
    for test in TESTS:
        run = subprocess.run([*emulate, str(tests / test)], capture_output=True, text=True)
        print(f"{target.processor} {test}: {run.stdout.splitlines()[-1:] or run.stderr}")
        if run.returncode:
            sys.exit(run.stdout + run.stderr)

    program = folder / "wheelwire" / "wheelwire-fwsim"
    program.chmod(0o755)
    emulated = folder / "emulated-fwsim"
    emulated.write_text(f'#!/bin/sh\nexec {" ".join(emulate)} {program} "$@"\n')
    emulated.chmod(0o755)
    environment = os.environ | {"WHEELWIRE_FWSIM": str(emulated)}
    _drive(str(ROOT / ".venv" / "bin" / "wheelwire"), folder, environment)


def _drive(command: str, folder: Path, environment: os._Environ[str] | dict[str, str]) -> None:
    """Start `wheelwire sim` and drive it."""
    port = folder / "robot"
    begin = time.monotonic()
    sim = subprocess.Popen(
        [command, "sim", "--link", str(port)],
        env=environment,
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    try:
        while not port.exists():
            if sim.poll() is not None or time.monotonic() > begin + TIMEOUT_S:
                sys.exit("`wheelwire sim` gave no port")
            time.sleep(0.01)
        drive = [command, "drive", str(port), "--linear", "0.2", "--seconds", "1", "--json"]
        for _ in range(TRIES):
            run = subprocess.run(
                drive, env=environment, cwd=folder, capture_output=True, text=True, check=False
            )
            if run.returncode == 0:
                break
    finally:
        sim.terminate()
        sim.wait()
    if run.returncode:
        sys.exit(f"`wheelwire drive` failed: {run.stderr}")
    print(f"the drive: {json.dumps(json.loads(run.stdout))}")


def main() -> None:
    """`wheels build` or `wheels check`, of what is named; by default of a release's processors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("action", choices=("build", "check"))
    parser.add_argument("of", nargs="*", choices=(*TARGETS, NATIVE, SOURCE_DISTRIBUTION, []))
    arguments = parser.parse_args()
    os.chdir(ROOT)
    for name in arguments.of or TARGETS:
        (build if arguments.action == "build" else check)(name)


if __name__ == "__main__":
    main()
