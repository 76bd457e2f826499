"""The URDF: one tree, the names that the node publishes, the numbers of its parameters, physics."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from wheelwire import load_config

MODEL = Path(__file__).parents[3] / "ros_node" / "urdf" / "pi4b.urdf"
RANGES = {"range_front": 0.0, "range_left": math.pi / 2, "range_right": -math.pi / 2}
"""Range sensors' frames, and where they look. [rad]"""
PLACES = {"base_link", "base_footprint", "imu_link", *RANGES}
"""Links without a body."""
WHEELS = {"left_wheel_joint": 1, "right_wheel_joint": -1}


@pytest.fixture(scope="module")
def robot() -> ET.Element:
    return ET.parse(MODEL).getroot()  # noqa: S314 - our own file


def test_the_links_are_one_tree(robot: ET.Element) -> None:
    links = {link.get("name") for link in robot.findall("link")}
    edges = {(_name(joint, "parent"), _name(joint, "child")) for joint in robot.findall("joint")}
    children = [child for _, child in edges]
    assert len(children) == len(set(children)) == len(robot.findall("joint"))
    assert links - set(children) == {"base_link"}
    reached = {"base_link"}
    while more := {child for parent, child in edges if parent in reached} - reached:
        reached |= more
    assert reached == links
    assert "laser_link" in links


def test_names_are_unique(robot: ET.Element) -> None:
    for kind in ("link", "joint"):
        names = [element.get("name") for element in robot.findall(kind)]
        assert len(names) == len(set(names))


@pytest.mark.parametrize(("name", "side"), WHEELS.items())
def test_the_wheels_are_the_parameters(robot: ET.Element, name: str, side: int) -> None:
    parameters = load_config().parameters
    radius = parameters["wheel_radius"]
    joint = _joint(robot, name)
    assert joint.get("type") == "continuous"
    assert _numbers(joint, "axis", "xyz") == (0, 1, 0)
    assert _numbers(joint, "origin", "xyz") == pytest.approx(
        (0, side * parameters["wheel_separation"] / 2, radius)
    )
    link = _link(robot, _name(joint, "child"))
    for cylinder in link.iter("cylinder"):
        assert float(cylinder.attrib["radius"]) == radius
    assert _numbers(link, "collision/origin", "rpy") == pytest.approx((math.pi / 2, 0, 0))


def test_the_wheel_joints_are_the_only_ones_that_move(robot: ET.Element) -> None:
    moving = {j.get("name") for j in robot.findall("joint") if j.get("type") != "fixed"}
    assert moving == set(WHEELS)


def test_names_are_what_the_node_publishes(robot: ET.Element) -> None:
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros.parameters import SETTINGS

    defaults = {setting.name: setting.default for setting in SETTINGS}
    assert [defaults["left_wheel_names"], defaults["right_wheel_names"]] == [[w] for w in WHEELS]
    for frame in ("base_frame_id", "imu_frame_id"):
        assert robot.find(f"link[@name='{defaults[frame]}']") is not None


def test_base_footprint_is_where_base_link_is(robot: ET.Element) -> None:
    """It must be the child: the node gives base_link its parent, odom."""
    (joint,) = [j for j in robot.findall("joint") if _name(j, "child") == "base_footprint"]
    assert _name(joint, "parent") == "base_link"
    assert joint.get("type") == "fixed"
    assert joint.find("origin") is None
    assert _joint(robot, "left_wheel_joint").find("parent[@link='base_link']") is not None


def test_the_imus_frame_has_the_robots_axes(robot: ET.Element) -> None:
    """The samples are in them, however the chip is mounted."""
    joint = _joint(robot, "imu_joint")
    assert _name(joint, "parent") == "base_link"
    assert "rpy" not in _the(joint, "origin").attrib


@pytest.mark.parametrize(("name", "yaw_rad"), RANGES.items())
def test_a_range_sensor_looks_along_its_x_away_from_the_robot(
    robot: ET.Element, name: str, yaw_rad: float
) -> None:
    joint = _joint(robot, f"{name}_joint")
    assert (_name(joint, "parent"), _name(joint, "child")) == ("base_link", name)
    turn = _the(joint, "origin").attrib.get("rpy", "0 0 0")
    assert [float(angle) for angle in turn.split()] == pytest.approx([0, 0, yaw_rad], abs=1e-6)
    x, y, z = _numbers(joint, "origin", "xyz")
    assert math.atan2(y, x) == pytest.approx(yaw_rad)
    assert z > 0


def test_the_caster_stands_on_the_floor(robot: ET.Element) -> None:
    sphere = _link(robot, "caster_link").find("collision/geometry/sphere")
    assert sphere is not None
    height = _numbers(_joint(robot, "caster_joint"), "origin", "xyz")[2]
    assert height == pytest.approx(float(sphere.attrib["radius"]))


def test_the_root_has_no_inertia(robot: ET.Element) -> None:
    assert _link(robot, "base_link").find("inertial") is None, "KDL ignores it, with a warning"


def test_inertias_are_those_of_the_bodies(robot: ET.Element) -> None:
    """Homogeneous bodies; the axes of inertia are those of the geometry."""
    inertials = [link for link in robot.findall("link") if link.find("inertial") is not None]
    bodies = {link.get("name") for link in robot.findall("link")} - PLACES
    assert {link.get("name") for link in inertials} == bodies
    for link in inertials:
        mass = _numbers(link, "inertial/mass", "value")[0]
        tensor = link.find("inertial/inertia")
        assert tensor is not None
        moments = [float(tensor.attrib[axis]) for axis in ("ixx", "iyy", "izz")]
        assert moments == pytest.approx(_moments(link, mass), rel=5e-3), link.get("name")
        assert all(float(tensor.attrib[axis]) == 0 for axis in ("ixy", "ixz", "iyz"))
        assert min(moments) > 0
        assert 2 * max(moments) <= sum(moments) * (1 + 1e-3), "no body has such moments"
        assert link.findtext("inertial/origin") == link.findtext("collision/origin")


def _moments(link: ET.Element, mass: float) -> list[float]:
    """Moments of inertia of a solid box, cylinder about z, or sphere."""
    geometry = link.find("collision/geometry")
    assert geometry is not None
    (shape,) = geometry
    if shape.tag == "box":
        x, y, z = (float(side) for side in shape.attrib["size"].split())
        return [mass / 12 * (a * a + b * b) for a, b in ((y, z), (x, z), (x, y))]
    radius = float(shape.attrib["radius"])
    if shape.tag == "sphere":
        return [0.4 * mass * radius**2] * 3
    across = mass / 12 * (3 * radius**2 + float(shape.attrib["length"]) ** 2)
    return [across, across, mass / 2 * radius**2]


def _joint(robot: ET.Element, name: str) -> ET.Element:
    return _the(robot, f"joint[@name='{name}']")


def _link(robot: ET.Element, name: str) -> ET.Element:
    return _the(robot, f"link[@name='{name}']")


def _the(element: ET.Element, path: str) -> ET.Element:
    found = element.find(path)
    assert found is not None, path
    return found


def _name(joint: ET.Element, end: str) -> str:
    return _the(joint, end).attrib["link"]


def _numbers(element: ET.Element, path: str, attribute: str) -> tuple[float, ...]:
    return tuple(float(number) for number in _the(element, path).attrib[attribute].split())
