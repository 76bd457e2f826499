"""A recording is opened by packages of others, without a plug-in of ours.

`make viewers-check` does it with those of npm.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from wheelwire import open_driver
from wheelwire.log.reader import TOPICS, messages
from wheelwire.log.views import BUMPERS, CHANNELS, ODOM


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated robot's, with every channel in use."""
    path = tmp_path_factory.mktemp("day") / "day.mcap"
    with open_driver("mock", record=path) as robot:
        robot.imu.read(timeout=2.0)
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            robot.set_velocity(0.2, 0.5, ttl=0.3)
            robot.read()
        robot.estop()
        robot.read()
    return path


def counted(path: Path) -> Counter[str]:
    return Counter(topic for topic, _, _ in messages(path))


def test_every_channel_has_what_viewers_ask_for(day: Path) -> None:
    with day.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} == {
        *TOPICS,
        *(channel.topic for channel in (*CHANNELS, BUMPERS)),
    }
    assert set(counted(day)) == {channel.topic for channel in summary.channels.values()}
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert schema.encoding == "ros2msg"
        assert schema.data
        assert channel.message_encoding == "cdr"
        assert "reliability: 1" in channel.metadata["offered_qos_profiles"]
    for index in summary.chunk_indexes:
        assert index.compression == ""


def test_by_mcaps_own_ros_support_and_by_rosbags(day: Path) -> None:
    by_package: list[list[tuple[str, Any]]] = []
    with day.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        decoded = reader.iter_decoded_messages()
        by_package.append([(channel.topic, message) for _, channel, _, message in decoded])
    with AnyReader([day]) as bag:
        by_package.append(
            [(one.topic, bag.deserialize(data, one.msgtype)) for one, _, data in bag.messages()]
        )
    for found in by_package:
        assert Counter(topic for topic, _ in found) == counted(day)
        *_, last = (message for topic, message in found if topic == ODOM.topic)
        assert last.pose.pose.position.x > 0.1


WITHOUT = """
import sys
for name in ("lz4", "lz4.frame", "zstandard"):
    sys.modules[name] = None  # its import fails, as on a 32-bit ARM
import time
from wheelwire import open_driver
from wheelwire.log.repair import repair
from wheelwire.log.summary import summary
with open_driver("mock", record=sys.argv[1]) as robot:
    time.sleep(1.2)
    robot.read()
assert summary(sys.argv[1]).complete
with open(sys.argv[1], "r+b") as file:
    file.truncate(file.seek(0, 2) - 3000)
assert repair(sys.argv[1])
print(summary(sys.argv[1]).frames_received)
"""


def test_without_the_packages_that_compress(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, "-c", WITHOUT, str(tmp_path / "day.mcap")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) > 50
