"""Builds tf2_msgs into this Python's environment, where ROS itself is not installed: `make ros`.

PyPI has the message generators of ROS 2, and rclpy, but not this package, without which nobody can
send or receive a transform. The generators get an environment of their own.

    build.py [DISTRIBUTION]      jazzy by default
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

SOURCE = Path(__file__).parent
DISTRIBUTION = sys.argv[1] if len(sys.argv) > 1 else "jazzy"
BUILD = SOURCE.parents[2] / "build" / "tf2_msgs" / DISTRIBUTION
GENERATORS = BUILD / "generators"
REQUIREMENTS = (
    "catkin_pkg",
    "empy==3.3.4",
    f"ros-{DISTRIBUTION}-ament-cmake",
    f"ros-{DISTRIBUTION}-ament-cmake-gmock",
    f"ros-{DISTRIBUTION}-ament-cmake-gtest",
    f"ros-{DISTRIBUTION}-ament-cmake-include-directories",
    f"ros-{DISTRIBUTION}-ament-cmake-pytest",
    f"ros-{DISTRIBUTION}-ament-cmake-ros",
    f"ros-{DISTRIBUTION}-ament-package",
    f"ros-{DISTRIBUTION}-geometry-msgs",
    "ros-jazzy-python-cmake-module"  # later ones have no such package
    if DISTRIBUTION == "jazzy"
    else f"ros-{DISTRIBUTION}-ament-cmake-ros-core",
    f"ros-{DISTRIBUTION}-rclpy[fastrtps]",
    f"ros-{DISTRIBUTION}-rosidl-core-generators",
    f"ros-{DISTRIBUTION}-rosidl-default-generators",
)
WHEEL_BUILDER = re.compile(
    r"""/opt/python/[^;" ]*?(?P<numpy>/site-packages/numpy\S*?)?/include[^;" ]*"""
)


def main() -> None:
    """Install the generators, then build and install the package."""
    BUILD.mkdir(parents=True, exist_ok=True)
    venv.create(GENERATORS, with_pip=True)
    python = GENERATORS / "bin" / "python"
    _run(str(python), "-m", "pip", "install", "--quiet", *REQUIREMENTS)
    _mend_include_paths(python)
    tree = str(BUILD / "tree")
    _run(
        "cmake", "-S", str(SOURCE), "-B", tree, "-G", "Ninja", "--log-level=WARNING",
        f"-DCMAKE_INSTALL_PREFIX={sys.prefix}",
        f"-DPython3_EXECUTABLE={python}",
        f"-DPYTHON_EXECUTABLE={python}",
    )  # fmt: skip
    _run("cmake", "--build", tree, "--target", "install", log=BUILD / "log.txt")


def _mend_include_paths(python: Path) -> None:
    """The wheels' CMake files name headers where the wheels were built; here they are elsewhere."""
    code = "import numpy; print(numpy.get_include())"
    numpy = subprocess.check_output([python, "-c", code], env=_environment(), text=True).strip()
    headers = sysconfig.get_path("include")
    for path in (GENERATORS / "share").rglob("*.cmake"):
        text = path.read_text()
        mended = WHEEL_BUILDER.sub(lambda m: numpy if m["numpy"] else headers, text)
        if mended != text:
            path.write_text(mended)


def _run(*command: str, log: Path | None = None) -> None:
    if log is None:
        subprocess.run(command, env=_environment(), check=True)
        return
    with log.open("w") as output:
        subprocess.run(command, env=_environment(), check=True, stdout=output)


def _environment() -> dict[str, str]:
    """For the generators' own Python, which finds its libraries by itself."""
    environment = dict(os.environ)
    for name in ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH"):
        environment.pop(name, None)
    environment["AMENT_PREFIX_PATH"] = environment["CMAKE_PREFIX_PATH"] = str(GENERATORS)
    environment["PATH"] = f"{GENERATORS / 'bin'}{os.pathsep}{environment['PATH']}"
    return environment


if __name__ == "__main__":
    main()
