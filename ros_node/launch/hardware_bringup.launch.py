"""A robot's nodes: wheels, lidar, and the model that connects their frames.

Without a namespace the topics are /cmd_vel, /odom, /scan, /tf. With one they are all below it,
including /tf, as Nav2 expects for several robots; the frames keep their names.
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription

SHARE = Path(__file__).parents[1]
"""The other folders are beside this one, installed or not."""
PARAMETERS = SHARE / "config" / "pi4b_params.yaml"
MODEL = SHARE / "urdf" / "pi4b.urdf"

TF_BELOW_NAMESPACE = [("/tf", "tf"), ("/tf_static", "tf_static")]
COMMON = {
    "namespace": LaunchConfiguration("namespace"),
    "remappings": TF_BELOW_NAMESPACE,
    "output": "screen",
}
RESPAWN = {"respawn": True, "respawn_delay": 2.0}
SWITCH = ["true", "false"]


def generate_launch_description() -> LaunchDescription:
    """The whole launch description; `ros2 launch --show-args` lists the arguments."""
    return LaunchDescription(
        [
            _argument("driver", "", "mock, l298n, pigpio or serial. Empty: as in params_file."),
            _argument("port", "", "Port of the serial driver. Empty: as in params_file."),
            _argument("params_file", str(PARAMETERS), "The robot's parameters."),
            _argument("lidar", "true", "Start the RPLidar's node.", SWITCH),
            _argument("lidar_port", "/dev/rplidar", "The RPLidar's port."),
            _argument("robot_state_publisher", "true", "Publish the robot's model.", SWITCH),
            _argument("namespace", "", "Namespace of all nodes, for several robots on one graph."),
            OpaqueFunction(function=_hardware_robot),
            _lidar(),
            _robot_state_publisher(),
        ]
    )


def _argument(
    name: str, default: str, description: str, choices: list[str] | None = None
) -> DeclareLaunchArgument:
    return DeclareLaunchArgument(
        name, default_value=default, description=description, choices=choices
    )


def _hardware_robot(context: LaunchContext) -> list[Node]:
    """An argument overrides the file, but only if it was given."""
    arguments = {"driver_type": "driver", "port": "port"}
    values = {p: LaunchConfiguration(a).perform(context) for p, a in arguments.items()}
    given = {parameter: value for parameter, value in values.items() if value}
    return [
        Node(
            package="wheelwire_ros",
            executable="hardware_robot",
            name="hardware_robot",
            parameters=[LaunchConfiguration("params_file"), given],
            **COMMON,
            **RESPAWN,
        )
    ]


def _lidar() -> Node:
    """An RPLidar A1 or A2. Jazzy's apt package has rplidar_composition, but no rplidar_node."""
    return Node(
        condition=IfCondition(LaunchConfiguration("lidar")),
        package="rplidar_ros",
        executable="rplidar_composition",
        name="rplidar_node",
        parameters=[
            {
                "serial_port": LaunchConfiguration("lidar_port"),
                "serial_baudrate": 115_200,
                "frame_id": "laser_link",
                "inverted": False,
                "angle_compensate": True,
            }
        ],
        **COMMON,
        **RESPAWN,
    )


def _robot_state_publisher() -> Node:
    return Node(
        condition=IfCondition(LaunchConfiguration("robot_state_publisher")),
        package="robot_state_publisher",
        executable="robot_state_publisher",
        parameters=[{"robot_description": ParameterValue(MODEL.read_text(), value_type=str)}],
        **COMMON,
    )
