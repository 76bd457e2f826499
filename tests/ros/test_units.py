"""The node under the conditions of its systemd unit, and of its container."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from support.confined import World
from support.ros import ENVIRONMENT, TIMEOUT_S, take_domain
from support.units import DOCKER, documented_units, group_id, image, services

TESTS = Path(__file__).parents[1]
SETUP = "/opt/ros/jazzy/setup.bash"
ROS2 = f"""#!/bin/sh
exec {sys.executable} -m support.ros2_stand_in "$@"
"""
CLIENT = """
import sys, time
import rclpy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

moved = []
rclpy.init()
node = rclpy.create_node("client")
node.create_subscription(
    Odometry, "odom", lambda odom: moved.append(odom.twist.twist.linear.x > 0.1), 10
)
commands = node.create_publisher(Twist, "cmd_vel", 1)
end_s = time.monotonic() + float(sys.argv[1])
while not any(moved) and time.monotonic() < end_s:
    commands.publish(Twist(linear=Vector3(x=0.2)))
    rclpy.spin_once(node, timeout_sec=0.05)
print(any(moved))
"""
"""Drives until the robot moves. It runs as the node's user: they share memory."""
MOCK = "/**: {ros__parameters: {driver_type: mock, pose_file: ~/pose.json}}\n"


@pytest.fixture
def setup() -> Iterator[str]:
    """The setup.bash of an installation that has the stand-in for `ros2`, on a free domain."""
    domain, reservation = take_domain()
    path = os.pathsep.join([str(TESTS), *sys.path])
    values = {**ENVIRONMENT, "ROS_DOMAIN_ID": domain, "PYTHONPATH": path}
    lines = [f"export {name}='{value}'\n" for name, value in values.items()]
    with reservation:
        yield "".join([*lines, f"export PATH=/opt/ros/jazzy/bin:{sys.prefix}/bin:$PATH\n"])


def add_ros(world: World, setup: str) -> None:
    world.add_file(SETUP, setup)
    world.add_file("/opt/ros/jazzy/bin/ros2", ROS2, executable=True)


def check_drives(world: World, environment: dict[str, str]) -> None:
    script = f'source {SETUP} && exec python3 -c "$@"'
    command = ["/bin/bash", "-c", script, "bash", CLIENT, str(TIMEOUT_S)]
    assert world.run(command, "/", environment) == (0, "True\n")


def interrupt(process: subprocess.Popen[str]) -> None:
    """End it as systemd and Docker do; that is no failure."""
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 0, output


def test_the_unit_starts_a_node_that_drives_and_saves_its_pose(setup: str) -> None:
    (unit,) = (one for one in documented_units() if one.page.endswith("wheelwire-ros.service"))
    assert unit.service["KillSignal"] == "SIGINT"
    with unit.world() as world:
        add_ros(world, setup)
        home = world.add_folder(unit.environment["HOME"])
        workspace = home / "robot_ws" / "install"
        workspace.mkdir(parents=True)
        (workspace / "setup.bash").touch()
        (home / "robot.yaml").write_text(MOCK)
        with world.start(unit.command, unit.folder, unit.environment) as process:
            check_drives(world, unit.environment)
            interrupt(process)
        assert (home / "pose.json").is_file()


def test_the_container_starts_a_node_that_drives_and_is_healthy(setup: str) -> None:
    """Its user has no home here, and the root is read-only, as in none of Docker's."""
    robot = services(DRIVER="mock")["robot"]
    user, group = map(int, robot["user"].split(":"))
    built = image()
    environment = built.environment | {"HOME": "/home/ubuntu", **robot["environment"]}
    with World(user, [group, *map(int, robot["group_add"])]) as world:
        add_ros(world, setup)
        world.add_file(f"{built.folder}/install/setup.bash", "")
        for inside, file in built.files.items():
            world.add_file(inside, (DOCKER / file).read_text(), executable=True)
        for volume in robot["volumes"]:
            outside, inside, *read_only = volume.split(":")
            if outside != inside:  # /dev is this computer's in any case
                assert read_only == ["ro"]
                for file in (DOCKER / outside).iterdir():
                    world.add_file(f"{inside}/{file.name}", file.read_text())
        command = [*built.entrypoint, *map(str, robot["command"])]
        with world.start(command, built.folder, environment) as process:
            check_drives(world, environment)
            kind, *check = robot["healthcheck"]["test"]
            assert kind == "CMD"
            assert world.run(check, built.folder, environment) == (0, "")
            interrupt(process)
        code, said = world.run(check, built.folder, environment)
        assert code == 1
        assert "does not report" in said


def test_the_groups_are_those_that_own_ports() -> None:
    """Docker takes numbers."""
    robot = services()["robot"]
    assert [int(one) for one in robot["group_add"]] == [group_id("dialout")]
