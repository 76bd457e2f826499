"""A robot's nodes: wheels, lidar, and the model that connects their frames.

There are two ways to distinguish several robots on one graph:

- `namespace`: topics, services and /tf are below it, as Nav2 expects; the frames keep their names.
- `namespace` and `frame_prefix`: the same, but all robots share one /tf, with frames of their own.

Joints keep their names: robot_state_publisher finds them in the model by their names in
joint_states, and that topic is below the namespace.
"""

from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchContext, LaunchDescription

SHARE = Path(__file__).parents[1]
"""The other folders are next to this one, installed or not."""
PARAMETERS = SHARE / "config" / "pi4b_params.yaml"
MODEL = SHARE / "urdf" / "pi4b.urdf"

TF_BELOW_NAMESPACE = [("/tf", "tf"), ("/tf_static", "tf_static")]
LASER_FRAME = "laser_link"


ARGUMENTS = {
    "driver": ("", "mock, l298n, pigpio, serial or replay. Empty: as in params_file."),
    "port": ("", "Port of the serial driver. Empty: as in params_file."),
    "params_file": (str(PARAMETERS), "YAML file of the robot's parameters."),
    "model": (str(MODEL), "URDF file of the robot's model."),
    "robot_state_publisher": ("true", "Publish the model: true or false."),
    "lidar": (
        "auto",
        "Start the RPLidar's node: true, false, or auto: if rplidar_ros is installed.",
    ),
    "lidar_port": ("/dev/rplidar", "The RPLidar's port."),
    "lidar_baud": (
        "115200",
        "The RPLidar's baud rate: 115200 of A1 and A2M8, 256000 of A2M7, A2M12 and A3.",
    ),
    "namespace": ("", "Namespace of all nodes, topics and services, /tf included."),
    "frame_prefix": (
        "",
        "Prefix of all frames, such as robot1: robot1/odom. /tf then stays outside the namespace, "
        "for all robots to share.",
    ),
    "use_sim_time": ("false", "Take the time from /clock: true or false."),
    "log_level": ("info", "Of all nodes: debug, info, warn, error or fatal."),
}
"""Each with its default and its description."""


def generate_launch_description() -> LaunchDescription:
    """The whole launch description; `ros2 launch --show-args` lists the arguments."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[Node | LogInfo]:
    prefix = _given("frame_prefix", context).strip("/")
    prefix = f"{prefix}/" if prefix else ""
    makers = (_hardware_robot, _lidar, _robot_state_publisher)
    return [make(context, prefix) for make in makers]


def _node(prefix: str, values: dict, *files: str, **options: object) -> Node:
    """A node with these parameters, which precede those in files, and with what all have."""
    clock = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    return Node(
        # If a parameter has two values, the later one counts.
        parameters=[*files, {**values, "use_sim_time": clock}],
        namespace=LaunchConfiguration("namespace"),
        # /tf is an absolute name, which a namespace alone does not move.
        remappings=[] if prefix else TF_BELOW_NAMESPACE,
        output="screen",
        arguments=["--ros-args", "--log-level", LaunchConfiguration("log_level")],
        respawn=True,
        respawn_delay=2.0,
        **options,
    )


def _hardware_robot(context: LaunchContext, prefix: str) -> Node:
    """An argument overrides the file, but only if it was given."""
    values = {
        "driver_type": _given("driver", context),
        "port": _given("port", context),
        "tf_frame_prefix": prefix,
    }
    return _node(
        prefix,
        {parameter: _text(value) for parameter, value in values.items() if value},
        str(_file("params_file", context)),
        package="wheelwire_ros",
        executable="hardware_robot",
        name="hardware_robot",
    )


def _lidar(context: LaunchContext, prefix: str) -> Node | LogInfo:
    """An RPLidar A1 or A2. Jazzy's apt package has rplidar_composition, but no rplidar_node."""
    condition = IfCondition(LaunchConfiguration("lidar"))
    if _given("lidar", context).strip().lower() == "auto":
        try:
            get_package_prefix("rplidar_ros")
        except PackageNotFoundError:
            return LogInfo(msg="no lidar: rplidar_ros is not installed")
        condition = None
    values = {
        "serial_port": _text(LaunchConfiguration("lidar_port")),
        "serial_baudrate": ParameterValue(LaunchConfiguration("lidar_baud"), value_type=int),
        "frame_id": _text(prefix + LASER_FRAME),
        "inverted": False,
        "angle_compensate": True,
    }
    return _node(
        prefix,
        values,
        condition=condition,
        package="rplidar_ros",
        executable="rplidar_composition",
        name="rplidar_node",
    )


def _robot_state_publisher(context: LaunchContext, prefix: str) -> Node:
    model = Path(_given("model", context)).expanduser()
    if model.suffix == ".xacro":
        urdf = model.with_suffix("").with_suffix(".urdf")
        raise ValueError(f"{model}: convert it first: xacro {model} > {urdf}")
    values = {
        "robot_description": _text(_file("model", context).read_text()),
        "frame_prefix": _text(prefix),  # it is put before the name as it is
    }
    return _node(
        prefix,
        values,
        condition=IfCondition(LaunchConfiguration("robot_state_publisher")),
        package="robot_state_publisher",
        executable="robot_state_publisher",
    )


def _file(argument: str, context: LaunchContext) -> Path:
    """A file that exists. launch only warns of another one, and the robot has no limits then."""
    path = Path(_given(argument, context)).expanduser()
    if not path.is_file():
        raise ValueError(f"{argument}: there is no file {path}")
    return path


def _given(argument: str, context: LaunchContext) -> str:
    return LaunchConfiguration(argument).perform(context)


def _text(value: object) -> ParameterValue:
    """A string, also where it looks like a number or a switch."""
    return ParameterValue(value, value_type=str)
