"""The compose file starts the launch file as it wants to be started."""

from __future__ import annotations

import re
from typing import Any

import pytest

from support.launch_stand_in import arguments, load, started
from support.units import DOCKER, services

PACKAGE = DOCKER.parent


@pytest.fixture(scope="module")
def robot() -> dict[str, Any]:
    return dict(services()["robot"])


def test_the_command_is_the_launch_files(robot: dict[str, Any]) -> None:
    ros2, launch, package, file, *given = robot["command"]
    assert (ros2, launch, package) == ("ros2", "launch", "wheelwire_ros")
    declared = arguments(load(PACKAGE / "launch" / file))
    values = dict(argument.split(":=", 1) for argument in given)
    assert values.keys() <= declared.keys()
    rules = (PACKAGE / "udev" / "70-wheelwire.rules").read_text()
    links = {f"/dev/{name}" for name in re.findall(r'SYMLINK\+="(\w+)"', rules)}
    assert {values["port"], values["lidar_port"]} == links
    mounts = dict(volume.split(":")[:2] for volume in robot["volumes"])
    assert all(values.values()), "launch refuses an empty value"
    assert values["params_file"] == f"{mounts['../config']}/pi4b_params.yaml"


def test_a_namespace_reaches_the_nodes_and_the_health_check() -> None:
    robot = services(NAMESPACE="robot1", FRAME_PREFIX="robot1")["robot"]
    assert {"namespace:=robot1", "frame_prefix:=robot1"} <= set(robot["command"])
    assert robot["healthcheck"]["test"][-1] == "robot1/hardware_robot"


def test_a_slash_means_no_prefix_and_no_namespace(robot: dict[str, Any]) -> None:
    given = dict(argument.split(":=") for argument in robot["command"] if ":=" in argument)
    # A volume of the container.
    given["params_file"] = str(PACKAGE / given["params_file"].removeprefix("/"))
    nodes = started(load(PACKAGE / "launch" / "hardware_bringup.launch.py"), **given)
    assert {node.namespace for node in nodes.values()} == {"/"}
    assert "tf_frame_prefix" not in nodes["hardware_robot"].parameters[1]
    assert robot["healthcheck"]["test"][-1] == "/hardware_robot"


def test_no_service_has_rights() -> None:
    for service in services().values():
        assert service["user"].split(":") == ["1000", "1000"]
        assert service["cap_drop"] == ["ALL"]
        assert service["security_opt"] == ["no-new-privileges:true"]
        assert not service.keys() & {"privileged", "cap_add", "devices", "pid"}
