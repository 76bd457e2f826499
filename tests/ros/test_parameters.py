"""Parameters: given in files, set while the node runs, and whether they reach the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import TwistStamped
from lifecycle_msgs.msg import Transition
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from support.cases import each
from support.ros import TIMEOUT_S, Diagnostics, Graph, Repeater, open_graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, Rig, open_rig, twist
from wheelwire import open_driver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_ros.parameter_values import ALIASES, same


def test_aliases_and_changes_reach_the_firmware_and_saved_ones_stay(tmp_path: Path) -> None:
    """Read back by another host, when the node has ended."""
    with open_graph() as graph, Simulator(link=tmp_path / "port") as simulator:
        with RobotNode(
            graph, serial_port=simulator.port, wheel_base=0.25, cpr=720, max_speed=0.3
        ) as node:
            graph.wait_active()
            assert graph.parameter(NODE, "wheel_separation") == 0.25
            assert graph.set_parameter(NODE, "proportional_gain", 2.5).successful
            assert graph.call(Trigger, f"{NODE}/save_parameters").success
            assert graph.set_parameter(NODE, "proportional_gain", 3.5).successful
        assert node.process.returncode == 0
        assert gain_and_geometry(simulator) == (3.5, 0.25, 720, 0.3)
        simulator.reset()
        assert gain_and_geometry(simulator) == (2.5, 0.25, 720, 0.3)


def gain_and_geometry(simulator: Simulator) -> tuple[float, ...]:
    with open_driver("serial", port=simulator.port, connect_timeout=TIMEOUT_S) as robot:
        drive = robot.geometry
        return (
            robot.parameters["proportional_gain"],
            drive.wheel_separation,
            drive.counts_per_revolution,
            drive.max_velocity_mps,
        )


DIFF_DRIVE_CONTROLLER = """
/**:
  ros__parameters:
    left_wheel_names: ["front_left_joint", "rear_left_joint"]
    right_wheel_names: ["front_right_joint", "rear_right_joint"]
    wheels_per_side: 2
    wheel_separation: 0.21
    wheel_radius: 0.034
    wheel_separation_multiplier: 1.0
    left_wheel_radius_multiplier: 1.0
    right_wheel_radius_multiplier: 1.0
    tf_frame_prefix_enable: false
    tf_frame_prefix: ""
    odom_frame_id: odom
    base_frame_id: base_footprint
    pose_covariance_diagonal: [0.001, 0.001, 0.001, 0.001, 0.001, 0.01]
    twist_covariance_diagonal: [0.001, 0.001, 0.001, 0.001, 0.001, 0.01]
    open_loop: false
    position_feedback: true
    enable_odom_tf: false
    cmd_vel_timeout: 0.5
    publish_limited_velocity: true
    velocity_rolling_window_size: 10
    publish_rate: 50.0
    linear:
      x:
        max_velocity: 0.25
        min_velocity: .NAN
        max_acceleration: 0.5
        max_deceleration: .NAN
        max_acceleration_reverse: .NAN
        max_deceleration_reverse: .NAN
        max_jerk: .NAN
        min_jerk: .NAN
    angular:
      z:
        has_velocity_limits: true
        max_velocity: .NAN
        max_acceleration: 1.0
        max_jerk: .NAN
"""


def written(values: dict[str, Any], path: Path) -> Path:
    plain = {name: _plain(value) for name, value in values.items()}
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": plain}}))
    return path


def _plain(value: Any) -> Any:
    return value if isinstance(value, str) or not hasattr(value, "__len__") else list(value)


def velocity(message: Any) -> tuple[float, float]:
    return message.twist.linear.x, message.twist.angular.z


def differences(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    return {
        name: (one.get(name), other.get(name))
        for name in one.keys() | other.keys()
        if not same(one.get(name), other.get(name))
    }


def test_a_dump_starts_the_same_robot(graph: Graph, simulator: Simulator, tmp_path: Path) -> None:
    given: dict[str, Any] = {"serial_port": simulator.port, "wheel_base": 0.25, "cpr": 720}
    with RobotNode(graph, autostart=False, **given, max_rpm=150, integral_gain=12.5):
        before = graph.dump(NODE)
        assert before["wheel_separation"] == 0.25
        assert before["max_rpm"] == 150.0
        assert "wheel_radius" not in before  # not known before the robot is open
        assert graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
        opened = graph.dump(NODE)
        assert opened["wheel_radius"] == pytest.approx(0.033)
        assert differences(before, {name: opened[name] for name in before}) == {}
    simulator.reset()  # forgets what was not saved
    for dump, name in ((before, "before"), (opened, "open")):
        file = written({**dump, "autostart": True}, tmp_path / f"{name}.yaml")
        with RobotNode(graph, file=file) as node:
            graph.wait_active()
            assert differences(graph.dump(NODE), {**opened, "autostart": True}) == {}
            assert "unknown parameters" not in node.errors()


def test_a_file_for_diff_drive_controller_starts_the_node_with_its_meaning(
    graph: Graph, tmp_path: Path
) -> None:
    file = tmp_path / "controller.yaml"
    file.write_text(DIFF_DRIVE_CONTROLLER)
    joints = graph.listen(JointState, "joint_states")
    limited = graph.listen(TwistStamped, f"{NODE}/cmd_vel_out")
    with RobotNode(graph, file=file, driver_type="mock") as node:
        graph.wait_active()
        assert "unknown parameters" not in node.errors()
        wait(lambda: joints, "joint_states")
        assert list(joints[-1].name) == [
            *("front_left_joint", "rear_left_joint"),
            *("front_right_joint", "rear_right_joint"),
        ]
        assert graph.parameter(NODE, "wheel_separation") == pytest.approx(0.21)
        commands = graph.publisher(type(twist(0.0)), "cmd_vel")
        with Repeater(commands, lambda: twist(1.0, 0.5)):
            # The turn rate is scaled with the speed.
            wait(
                lambda: limited and velocity(limited[-1]) == pytest.approx((0.25, 0.125)),
                "the greatest speed",
            )
        speeds = [velocity(message)[0] for message in tuple(limited)]
        assert speeds[0] <= 0.5 * 0.05 + 1e-9
        assert max(speeds) == pytest.approx(0.25)
        assert limited[-1].header.frame_id == "base_footprint"
        limited.clear()
        commands.publish(twist(0.0))
        wait(lambda: limited and velocity(limited[-1])[0] == 0.0, "the stop")
        # At once: no slower step follows the commands in flight.
        assert {velocity(message)[0] for message in tuple(limited)} <= {speeds[-1], 0.0}


REFUSED: dict[str, tuple[Any, str, Any]] = {
    "cmd_vel_timeout": (0.0, "every command must expire", 0.5),
    "cmd_vel_type": ("Vector3", "one of Twist, TwistStamped, auto", "auto"),
    "publish_rate": (0.0, "publish_rate out of range", 50.0),
    "wheel_radius": (9.0, "wheel_radius out of range", 0.033),
    "open_loop": (True, "does not drive without them", False),
    "velocity_rolling_window_size": (0, "velocity_rolling_window_size out of range", 10),
    "linear.x.has_jerk_limits": (False, "write .NAN for the limits of jerk", True),
    "left_wheel_names": ("[]", "write at least one name", ["left"]),
    "base_frame_id": ("odom", "they are equal", "base_link"),
    "pose_covariance_diagonal": ("[0.1]", "it has 1 numbers: write six", [0.1] * 6),
    "use_stamped_vel": ("maybe", "use_stamped_vel: Wrong parameter type", False),
    "wheel_separation": (
        0.3,
        "wheel_base is another name of wheel_separation, and they differ",
        0.4,
    ),
}
"""Parameters, a wrong value of each, what the node says of it, and a right value."""


def test_refused_values_keep_the_node_up_and_unconfigured_until_all_are_set(graph: Graph) -> None:
    given = {name.replace(".", "__"): value for name, (value, _, _) in REFUSED.items()}
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, driver_type="mock", wheel_base=0.4, **given) as node:
        wait(lambda: "refused parameters" in node.errors(), "the refusal in the log")
        (line,) = [line for line in node.errors().splitlines() if "refused parameters" in line]
        for name, (_, words, _) in REFUSED.items():
            assert f"{name}: " in line
            assert words in line
        diagnostics.wait("link", lambda status, _: "refused parameters" in status.message)
        for name, (_, _, instead) in REFUSED.items():
            graph.wait_state(NODE, "unconfigured")
            assert not graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
            assert graph.set_parameter(NODE, name, instead).successful
        graph.wait_active()
        assert node.process.poll() is None


FILES_THAT_CANNOT_BE_READ = {
    "/**:\n  ros__parameters:\n    a: [0, 0.1]\n": "Sequence should be of same type",
    # The library's own file of a robot.
    (files("wheelwire.tools.files") / "pi4b_robot.yaml").read_text(): (
        "a ROS parameter file has its values below `/**:`"
    ),
}


@pytest.mark.parametrize(("text", "words"), FILES_THAT_CANNOT_BE_READ.items())
def test_a_file_that_cannot_be_read_keeps_the_node_up_and_unconfigured(
    graph: Graph, tmp_path: Path, text: str, words: str
) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with RobotNode(graph, file=file, driver_type="mock") as node:
        wait(lambda: "refused parameters" in node.errors(), "the refusal in the log")
        (line,) = [line for line in node.errors().splitlines() if "refused parameters" in line]
        assert words in line
        assert str(file) in line
        graph.wait_state(NODE, "unconfigured")
        assert graph.parameter(NODE, "driver_type") == "mock"  # what is not in the file counts
        assert "Traceback" not in node.errors()


GUIDE = """
/**:
  ros__parameters:
    driver_type: mock
    wheel_base: 0.20
    wheel_radius: 0.033
    max_speed: 0.4
    cpr: 360
    pwm_frequency: 20000.0
    max_rpm: 200
    pigpio_host: localhost
    pins:
      left_pwm: 18
      left_dir1: 23
      left_dir2: 24
      right_pwm: 19
      right_dir1: 5
      right_dir2: 6
      left_enc_a: 17
      left_enc_b: 27
      right_enc_a: 22
      right_enc_b: 10
"""


def test_names_and_types_that_people_write_are_taken(graph: Graph, tmp_path: Path) -> None:
    file = tmp_path / "guide.yaml"
    file.write_text(GUIDE)
    beside: dict[str, Any] = {
        "wheel_separation": 0.20,  # as its other name, in the file
        "publish_rate": 20,
        "left_wheel_name": "wheel_of_old",
        "linear.x.max_velocity": math.nan,
    }
    given = yaml.safe_load(GUIDE)["/**"]["ros__parameters"] | beside
    given |= {f"pins.{name}": pin for name, pin in given.pop("pins").items()}
    given["left_wheel_name"] = ["wheel_of_old"]
    arguments = {name.replace(".", "__"): value for name, value in beside.items()}
    with RobotNode(graph, file=file, wheelradius=0.03, lidar_model="A1", **arguments) as node:
        graph.wait_active()
        have = graph.dump(NODE)
        for name, value in given.items():
            assert same(have[ALIASES.get(name, name)], value), name
        assert have.keys().isdisjoint(ALIASES)
        (warning,) = [line for line in node.errors().splitlines() if "unknown parameters" in line]
        words = "unknown parameters, ignored: lidar_model, wheelradius (did you mean wheel_radius?)"
        assert words in warning


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(tmp_path_factory.mktemp("rig"), max_velocity_mps=0.35) as rig:
        yield rig


def test_they_describe_themselves_with_their_ranges(rig: Rig) -> None:
    gain = rig.graph.describe(NODE, "proportional_gain")
    definition = PARAMETER_BY_NAME["proportional_gain"]
    assert gain.floating_point_range[0].from_value == definition.minimum
    assert gain.floating_point_range[0].to_value == definition.maximum
    assert definition.doc in gain.description
    counts = rig.graph.describe(NODE, "counts_per_revolution")
    assert counts.integer_range[0].to_value == 200_000
    assert rig.graph.describe(NODE, "cmd_vel_timeout").floating_point_range


def test_a_limit_of_the_robot_takes_effect_at_once(rig: Rig) -> None:
    assert rig.graph.set_parameter(NODE, "max_velocity_mps", 0.2).successful
    with rig.driving(0.4):
        rig.truth(lambda state: state.left_mps > 0.05)
        odometry = len(rig.odometry)
        wait(lambda: len(rig.odometry) > odometry + 50, "a second of odom")
        fastest_mps = max(state.left_mps for state in rig.simulator.take_states())
    assert fastest_mps == pytest.approx(0.2, abs=0.03)


@each(
    ("name", "value", "reason"),
    [
        ("proportional_gain", -1.0, "out of range"),
        ("cmd_vel_timeout", float("nan"), "out of range"),
        ("cmd_vel_timeout", 0.0, "Min: 0.02"),
        ("cmd_vel_timeout", 1.5, "ttl_max_s: a command of 1.5 s is longer"),
        ("ttl_max_s", 0.3, "cmd_vel_timeout, ttl_max_s: a command of 0.5 s is longer"),
        ("odom_frame_id", "elsewhere", "read when the node is configured"),
        ("wheel_base", 0.3, "undeclared"),
        ("control_rate_hz", 333.0, "type"),
        ("max_rpm", 0.0, "above 0.0, or .NAN"),
        ("base_frame_id", "odom", "they are equal"),
        ("left_wheel_names", ["a", "b"], "2 wheels on the left and 1 on the right"),
        ("open_loop", True, "does not drive without them"),
    ],
)
def test_an_impossible_value_is_refused_with_the_reason(
    rig: Rig, name: str, value: Any, reason: str
) -> None:
    before = rig.graph.dump(NODE)
    result = rig.graph.set_parameter(NODE, name, value)
    assert not result.successful
    assert reason in result.reason
    after = rig.graph.dump(NODE)
    assert all(same(after[one], before[one]) for one in before)
