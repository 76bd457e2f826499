"""Builds the node with colcon in both ways that docs/ros.md shows, and starts the results.

tools/check_colcon.py FOLDER      for the workspaces; removed first
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NAME = "wheelwire_ros"
CODE = """
import pathlib, sys
from ament_index_python.packages import get_package_share_directory
share = pathlib.Path(get_package_share_directory("wheelwire_ros"))
assert share.is_relative_to(sys.argv[1]), share
assert (share / "launch" / "hardware_bringup.launch.py").is_file()
assert (share / "package.xml").is_file()
"""


def main() -> None:
    """Build and check both; an exception or a message is a failure."""
    folder = Path(sys.argv[1]).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    for way in ("base-paths", "link"):
        workspace = folder / way
        (workspace / "src").mkdir(parents=True)
        arguments = []
        if way == "link":
            (workspace / "src" / NAME).symlink_to(ROOT / "ros_node")
        else:
            arguments = ["--base-paths", str(ROOT / "ros_node")]
        _run([sys.executable, "-m", "colcon", "build", *arguments], workspace)
        _check(workspace / "install" / NAME)
        print(f"{way}: built and found")
    command = [sys.executable, "-m", "colcon", "list", "--names-only", "--base-paths", str(ROOT)]
    # It writes its log to the folder.
    found = subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder)
    if listed := found.stdout.split():
        sys.exit(f"colcon finds {listed} in the repository's root: it would build the firmware")


def _check(installed: Path) -> None:
    if not (installed / "lib" / NAME / "hardware_robot").is_file():
        sys.exit(f"{installed}: no executable for `ros2 run`")
    (packages,) = installed.glob("lib/python*/site-packages")
    if not (packages / NAME / "hardware_robot.py").is_file():
        sys.exit(f"{packages}: no {NAME}")
    path = os.pathsep.join([str(packages), os.environ.get("PYTHONPATH", "")])
    environment = {"PYTHONPATH": path, "AMENT_PREFIX_PATH": str(installed)}
    _run([sys.executable, "-c", CODE, str(installed)], installed, environment)


def _run(command: list[str], folder: Path, environment: dict[str, str] | None = None) -> None:
    subprocess.run(command, cwd=folder, env={**os.environ, **(environment or {})}, check=True)


if __name__ == "__main__":
    main()
