"""The SROS 2 policy names what the node really has; nobody can command or clear by mistake."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

import rclpy
from rclpy.action.graph import get_action_server_names_and_types_by_node
from rclpy.parameter import Parameter

from support.cases import each
from support.pages import ROOT
from support.range_board import simulator_on_board
from support.ros import Graph, open_graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE
from wheelwire.simulation.simulator import Simulator

POLICY = ROOT / "ros_node" / "security" / "wheelwire.policy.xml"
RIGHTS = (("topic", "publish"), ("topic", "subscribe"), ("service", "reply"))
RANGES = {"/range/front", "/range/left"}
OTHERS = ("driver", "operator", "viewer")
TAGS = {
    "policy": ({"version"}, {"enclaves"}),
    "enclaves": (set(), {"enclave"}),
    "enclave": ({"path"}, {"profiles"}),
    "profiles": (set(), {"profile"}),
    "profile": ({"ns", "node"}, {"topics", "services"}),
    "topics": ({"publish", "subscribe"}, {"topic"}),
    "services": ({"reply", "request"}, {"service"}),
    "topic": (set(), set()),
    "service": (set(), set()),
}
"""Of sros2's policy.xsd, what the file may use: attributes and children."""


def root() -> ET.Element:
    return ET.parse(POLICY).getroot()  # noqa: S314 - it is our own


def profile(enclave: str) -> ET.Element:
    (found,) = root().findall(f".//enclave[@path='/wheelwire/{enclave}']//profile")
    return found


def names(enclave: str, kind: str, right: str) -> set[str]:
    """What an enclave may do: full names, made as sros2's permissions.xsl makes them."""
    node = profile(enclave)
    namespace = str(node.get("ns")).rstrip("/") + "/"

    def full(name: str) -> str:
        own = f"{namespace}{node.get('node')}"
        return own + name[1:] if name.startswith("~") else namespace + name

    groups = node.findall(f"{kind}s[@{right}='ALLOW']")
    return {full(str(one.text)) for group in groups for one in group.findall(kind)}


def of_node(graph: Graph, name: str) -> dict[str, set[str]]:
    """What a node has, by the graph: each name under its right."""
    node = graph.node
    found = {
        "publish": node.get_publisher_names_and_types_by_node(name, "/"),
        "subscribe": node.get_subscriber_names_and_types_by_node(name, "/"),
        "reply": node.get_service_names_and_types_by_node(name, "/"),
    }
    return {right: {one for one, _ in pairs} for right, pairs in found.items()}


def test_it_has_the_form_of_sros2() -> None:
    found = root()
    assert (found.tag, found.get("version")) == ("policy", "0.2.0")
    for element in found.iter():
        attributes, children = TAGS[element.tag]
        assert set(element.keys()) <= attributes, element.tag
        assert {child.tag for child in element} <= children, element.tag
        if "ALLOW" in element.attrib.values():
            assert len(element.attrib) == 1


def test_the_node_may_do_what_it_does_and_nothing_else(
    graph: Graph, simulator: Simulator, tmp_path: Path
) -> None:
    found: dict[str, set[str]] = {right: set() for _, right in RIGHTS}
    with simulator_on_board(link=tmp_path / "ranges") as with_ranges:
        for port, own in ((simulator.port, {"/bumpers"}), (with_ranges.port, RANGES)):
            with RobotNode(graph, port=port, publish_limited_velocity=True, use_sim_time=True):
                graph.wait_active()
                wait(lambda: of_node(graph, "hardware_robot")["publish"] >= own, f"{own}")  # noqa: B023
                for right, named in of_node(graph, "hardware_robot").items():
                    found[right] |= named
                actions = get_action_server_names_and_types_by_node
                assert not actions(graph.node, "hardware_robot", "/")
            wait(lambda: "hardware_robot" not in graph.node.get_node_names(), "its end")
    for kind, right in RIGHTS:
        allowed = names("robot", kind, right)
        unmatched = allowed.copy()
        for name in found[right]:
            by = {one for one in allowed if fnmatch(name, one)}
            assert by, f"{right} {name} is refused"
            unmatched -= by
        assert not unmatched, f"{right}: the node has none of these"


@each("enclave", OTHERS)
def test_a_node_of_another_enclave_may_start(enclave: str) -> None:
    name = str(profile(enclave).get("node"))
    with open_graph() as graph:
        on_clock = [Parameter("use_sim_time", value=True)]
        node = rclpy.create_node(name, context=graph._context, parameter_overrides=on_clock)
        try:
            wait(lambda: "/clock" in of_node(graph, name)["subscribe"], "the node")
            found = of_node(graph, name)
        finally:
            node.destroy_node()
    for kind, right in RIGHTS:
        assert found[right] <= names(enclave, kind, right), right


def test_one_commands_and_another_clears() -> None:
    assert "/cmd_vel" in names("driver", "topic", "publish")
    for one in ("operator", "viewer"):
        assert "/cmd_vel" not in names(one, "topic", "publish")
    clears = {f"{NODE}/estop", f"{NODE}/clear_fault", f"{NODE}/set_parameters"}
    assert clears <= names("operator", "service", "request")
    for one in ("driver", "viewer"):
        assert clears.isdisjoint(names(one, "service", "request"))
    assert names("driver", "service", "request") == {f"{NODE}/stop"}
    assert not names("viewer", "service", "request")


def test_the_others_ask_and_hear_only_what_there_is() -> None:
    general = {"/rosout", "/parameter_events", "/clock"}
    served = names("robot", "service", "reply")
    published = names("robot", "topic", "publish") | general
    heard = names("robot", "topic", "subscribe") | general
    for one in OTHERS:
        assert names(one, "service", "request") <= served
        assert names(one, "topic", "subscribe") <= published
        assert names(one, "topic", "publish") <= heard


def test_the_page_names_the_enclaves() -> None:
    page = (ROOT / "docs" / "ros.md").read_text()
    enclaves = [str(one.get("path")) for one in root().iter("enclave")]
    assert enclaves == [f"/wheelwire/{name}" for name in ("robot", *OTHERS)]
    for enclave in enclaves:
        assert f"- `{enclave.rpartition('/')[2]}`:" in page
