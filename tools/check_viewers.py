"""Checks that the packages used by Foxglove and Lichtblick can read a recording.

Records a simulated robot, reads the file by npm's @mcap/core and @foxglove/rosmsg2-serialization,
and compares what they find with what was recorded. Needs node and npm: `make viewers-check`.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from wheelwire import open_driver
from wheelwire.log.reader import messages
from wheelwire.log.views import BATTERY, JOINT_STATES, JOINTS, ODOM

PACKAGES = ("@mcap/core@2.2.2", "@foxglove/rosmsg@5.0.5", "@foxglove/rosmsg2-serialization@3.1.0")
SCRIPT = Path(__file__).with_name("read_recording.mjs")
SECONDS = 3.0


def record(path: Path) -> None:
    """Drive a simulated robot in a circle, and stop it."""
    with open_driver("mock", record=path) as robot:
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            robot.set_velocity(0.2, 0.5, ttl=0.3)
            robot.read()
        robot.estop()
        robot.read()


def install(folder: Path) -> None:
    """Have the packages in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    command = ["npm", "install", "--silent", "--no-audit", "--no-fund", "--ignore-scripts"]
    subprocess.run([*command, "--prefix", str(folder), *PACKAGES], check=True)
    # A script imports packages from its own folder upwards.
    (folder / SCRIPT.name).write_text(SCRIPT.read_text("utf-8"), "utf-8")


def read(path: Path, folder: Path) -> Any:
    """What they find in a file."""
    command = ["node", str(folder / SCRIPT.name), str(path)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> int:
    """Record, read, compare."""
    folder = Path("build") / "viewers"
    install(folder)
    with tempfile.TemporaryDirectory() as there:
        path = Path(there) / "day.mcap"
        record(path)
        found = read(path, folder.absolute())
        ours = Counter(topic for topic, _, _ in messages(path))
    topics = found["topics"]
    for name, topic in sorted(topics.items()):
        print(f"{name}: {topic['count']} x {topic['schema']}")
    newest = {name: topic["newest"] for name, topic in topics.items()}
    expected = {
        "the profile is ros2": found["profile"] == "ros2",
        "all messages are read": {n: t["count"] for n, t in topics.items()} == dict(ours),
        "the robot has driven": newest[ODOM]["pose"]["pose"]["position"]["x"] > 0.1,
        "the joints have names": newest[JOINT_STATES]["name"] == list(JOINTS),
        "the battery has a voltage": newest[BATTERY]["voltage"] > 1,
    }
    if wrong := [what for what, holds in expected.items() if not holds]:
        print("not true:", "; ".join(wrong))
        return 1
    print("all messages are those that were recorded")
    return 0


if __name__ == "__main__":
    sys.exit(main())
