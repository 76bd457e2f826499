"""What the launch file starts; executed, with a stand-in for launch and launch_ros."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from support.launch_stand_in import LaunchDescription, Node, arguments, load, started

PACKAGE = Path(__file__).parents[3] / "ros_node"
PARAMETERS = str(PACKAGE / "config" / "pi4b_params.yaml")
ROBOT, LIDAR, MODEL = "hardware_robot", "rplidar_composition", "robot_state_publisher"


@pytest.fixture(scope="module")
def bringup() -> LaunchDescription:
    return load(PACKAGE / "launch" / "hardware_bringup.launch.py")


def test_the_arguments(bringup: LaunchDescription) -> None:
    declared = arguments(bringup)
    assert {name: argument.default_value for name, argument in declared.items()} == {
        "driver": "",
        "port": "",
        "params_file": PARAMETERS,
        "lidar": "true",
        "lidar_port": "/dev/rplidar",
        "robot_state_publisher": "true",
        "namespace": "",
    }
    assert all(argument.description for argument in declared.values())


def test_all_three_nodes_by_default(bringup: LaunchDescription) -> None:
    nodes = started(bringup)
    assert set(nodes) == {ROBOT, LIDAR, MODEL}
    assert {node.output for node in nodes.values()} == {"screen"}


@pytest.mark.parametrize(
    ("switch", "executable"), [("lidar", LIDAR), ("robot_state_publisher", MODEL)]
)
def test_a_node_can_be_left_out(bringup: LaunchDescription, switch: str, executable: str) -> None:
    assert set(started(bringup, **{switch: "false"})) == {ROBOT, LIDAR, MODEL} - {executable}


def test_the_robot_is_as_the_file_says(bringup: LaunchDescription) -> None:
    robot = started(bringup)[ROBOT]
    assert (robot.package, robot.name) == ("wheelwire_ros", "hardware_robot")
    assert robot.parameters == [PARAMETERS, {}]
    assert Path(PARAMETERS).is_file()


def test_arguments_go_before_the_file(bringup: LaunchDescription) -> None:
    robot = started(bringup, params_file="mine.yaml", driver="pigpio", port="/dev/ttyACM0")[ROBOT]
    assert robot.parameters == ["mine.yaml", {"driver_type": "pigpio", "port": "/dev/ttyACM0"}]


def test_the_lidar_is_the_guides(bringup: LaunchDescription) -> None:
    lidar = started(bringup, lidar_port="/dev/ttyUSB7")[LIDAR]
    assert (lidar.package, lidar.name) == ("rplidar_ros", "rplidar_node")
    assert lidar.parameters == [
        {
            "serial_port": "/dev/ttyUSB7",
            "serial_baudrate": 115_200,
            "frame_id": "laser_link",
            "inverted": False,
            "angle_compensate": True,
        }
    ]
    assert not any("scan" in name for pair in lidar.remappings for name in pair)


def test_the_model_is_published(bringup: LaunchDescription) -> None:
    model = started(bringup)[MODEL]
    (parameters,) = model.parameters
    assert model.package == MODEL
    assert ET.fromstring(parameters["robot_description"]).tag == "robot"  # noqa: S314 - our own


@pytest.mark.parametrize("executable", [ROBOT, LIDAR])
def test_what_talks_to_hardware_is_started_again(
    bringup: LaunchDescription, executable: str
) -> None:
    node = started(bringup)[executable]
    assert node.respawn
    assert node.respawn_delay == 2.0


def test_a_namespace_holds_everything(bringup: LaunchDescription) -> None:
    nodes = started(bringup, namespace="robot1")
    for node in nodes.values():
        assert node.namespace == "robot1"
        assert _remapped(node) == {"/tf": "tf", "/tf_static": "tf_static"}


def _remapped(node: Node) -> dict[str, str]:
    return dict(node.remappings)
