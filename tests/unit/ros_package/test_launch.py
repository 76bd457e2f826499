"""What the launch file starts; executed, with a stand-in for launch and launch_ros."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from support.launch_stand_in import LaunchDescription, Node, arguments, load, started

PACKAGE = Path(__file__).parents[3] / "ros_node"
PARAMETERS = str(PACKAGE / "config" / "pi4b_params.yaml")
URDF = PACKAGE / "urdf" / "pi4b.urdf"
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
        "model": str(URDF),
        "robot_state_publisher": "true",
        "lidar": "auto",
        "lidar_port": "/dev/rplidar",
        "lidar_baud": "115200",
        "namespace": "",
        "frame_prefix": "",
        "use_sim_time": "false",
        "log_level": "info",
    }
    assert all(argument.description.endswith(".") for argument in declared.values())


def test_without_its_package_there_is_no_lidar_unless_it_is_asked_for(
    bringup: LaunchDescription, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("support.launch_stand_in.installed", {"robot_state_publisher"})
    assert set(started(bringup)) == {ROBOT, MODEL}
    assert set(started(bringup, lidar="true")) == {ROBOT, LIDAR, MODEL}


@pytest.mark.parametrize("no", ["false", "False", "FALSE", "0"])
@pytest.mark.parametrize(
    ("switch", "executable"), [("lidar", LIDAR), ("robot_state_publisher", MODEL)]
)
def test_a_node_can_be_left_out(
    bringup: LaunchDescription, switch: str, executable: str, no: str
) -> None:
    assert set(started(bringup, **{switch: no})) == {ROBOT, LIDAR, MODEL} - {executable}
    yes = no.replace("0", "1").replace("false", "true").replace("False", "True")
    assert executable in started(bringup, **{switch: yes.replace("FALSE", "TRUE")})


def test_the_robot_is_as_the_file_says(bringup: LaunchDescription) -> None:
    robot = started(bringup)[ROBOT]
    assert (robot.package, robot.name) == ("wheelwire_ros", "hardware_robot")
    assert robot.parameters == [PARAMETERS, {"use_sim_time": False}]
    assert Path(PARAMETERS).is_file()


def test_arguments_go_before_the_file(bringup: LaunchDescription, tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.touch()
    robot = started(bringup, params_file=str(mine), driver="pigpio", port="/dev/ttyACM0")[ROBOT]
    given = {"driver_type": "pigpio", "port": "/dev/ttyACM0", "use_sim_time": False}
    assert robot.parameters == [str(mine), given]


@pytest.mark.parametrize("argument", ["params_file", "model"])
@pytest.mark.parametrize("given", ["missing", "~/missing", "."])
def test_an_invalid_file_ends_the_launch_with_one_line(
    bringup: LaunchDescription, argument: str, given: str
) -> None:
    """Without its file the robot would start without its limits."""
    path = Path(given).expanduser()
    with pytest.raises(ValueError, match=rf"^{argument}: there is no file {path}$"):
        started(bringup, **{argument: given})


def test_a_file_in_the_home_folder_is_found(
    bringup: LaunchDescription, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine.yaml").touch()
    robot = started(bringup, params_file="~/mine.yaml")[ROBOT]
    assert robot.parameters[0] == str(tmp_path / "mine.yaml")


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
            "use_sim_time": False,
        }
    ]
    assert not any("scan" in name for pair in lidar.remappings for name in pair)


def test_the_model_is_published(bringup: LaunchDescription, tmp_path: Path) -> None:
    model = started(bringup)[MODEL]
    assert model.package == MODEL
    assert _only_parameters(model)["robot_description"] == URDF.read_text()
    mine = tmp_path / "mine.urdf"
    mine.write_text("<robot name='mine'/>")
    other = started(bringup, model=str(mine))[MODEL]
    assert _only_parameters(other)["robot_description"] == mine.read_text()


@pytest.mark.parametrize("given", ["/mine.urdf.xacro", "/mine.xacro"])
def test_a_model_that_xacro_must_convert_first_is_refused(
    bringup: LaunchDescription, given: str
) -> None:
    with pytest.raises(ValueError, match=rf"xacro {given} > /mine\.urdf$"):
        started(bringup, model=given)


@pytest.mark.parametrize("executable", [ROBOT, LIDAR, MODEL])
def test_launch_restarts_a_node_that_ends(bringup: LaunchDescription, executable: str) -> None:
    node = started(bringup)[executable]
    assert node.respawn
    assert node.respawn_delay == 2.0


def test_a_namespace_holds_everything(bringup: LaunchDescription) -> None:
    nodes = started(bringup, namespace="robot1")
    for node in nodes.values():
        assert node.namespace == "robot1"
        assert dict(node.remappings) == {"/tf": "tf", "/tf_static": "tf_static"}
    assert _only_parameters(nodes[MODEL])["frame_prefix"] == ""
    assert "tf_frame_prefix" not in nodes[ROBOT].parameters[1]


@pytest.mark.parametrize("given", ["robot1", "robot1/", "/robot1"])
def test_a_prefix_reaches_all_frames(bringup: LaunchDescription, given: str) -> None:
    """The model's, the lidar's and the odometry's are the same tree."""
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros import parameters, publishers

    nodes = started(bringup, namespace="robot1", frame_prefix=given)
    links = {link.attrib["name"] for link in ET.parse(URDF).getroot().iter("link")}  # noqa: S314
    prefix = _only_parameters(nodes[MODEL])["frame_prefix"]
    assert prefix == "robot1/"
    in_tree = {prefix + link for link in links}
    assert _only_parameters(nodes[LIDAR])["frame_id"] in in_tree
    defaults = {setting.name: setting.default for setting in parameters.SETTINGS}
    get = {**defaults, **nodes[ROBOT].parameters[1]}.__getitem__
    assert publishers.frame("base_frame_id", get) in in_tree
    assert publishers.frame("odom_frame_id", get) == "robot1/odom"
    for node in nodes.values():
        assert node.namespace == "robot1"
        assert not node.remappings, "all robots share one /tf"


def test_a_prefix_that_looks_like_a_number_is_text(bringup: LaunchDescription) -> None:
    nodes = started(bringup, frame_prefix="7", port="8")
    assert nodes[ROBOT].parameters[1]["tf_frame_prefix"] == "7/"
    assert nodes[ROBOT].parameters[1]["port"] == "8"
    assert _only_parameters(nodes[LIDAR])["frame_id"] == "7/laser_link"


@pytest.mark.parametrize("given", ["true", "True", "TRUE"])
def test_all_nodes_take_the_same_clock(bringup: LaunchDescription, given: str) -> None:
    for node in started(bringup, use_sim_time=given).values():
        assert node.parameters[-1]["use_sim_time"] is True


def test_all_nodes_log_from_the_same_level(bringup: LaunchDescription) -> None:
    for node in started(bringup, log_level="debug").values():
        assert node.arguments == ["--ros-args", "--log-level", "debug"]


def _only_parameters(node: Node) -> dict[str, Any]:
    (parameters,) = node.parameters
    return dict(parameters)
