"""The image and the compose file, as far as they can be checked without Docker."""

from __future__ import annotations

import re
import shlex
import stat
from pathlib import Path
from typing import Any

import pytest
import yaml

from support.launch_stand_in import arguments, load, started

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "ros_node"
DOCKER = PACKAGE / "docker"
TTY_USB, TTY_ACM, TTY_AMA = "188", "166", "204"
"""Major numbers of the kernel's devices.txt."""
COMPOSE = DOCKER / "docker-compose.pi.yml"


def interpolated(**environment: str) -> dict[str, Any]:
    """The services, with the environment's values where the file asks for them."""
    text = COMPOSE.read_text()
    text = re.sub(r"\$\{(\w+):-([^}]*)\}", lambda m: environment.get(m[1]) or m[2], text)
    assert "${" not in text, "another form of interpolation"
    return dict(yaml.safe_load(text)["services"])


@pytest.fixture(scope="module")
def instructions() -> list[list[str]]:
    text = (DOCKER / "Dockerfile").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    joined = "\n".join(lines).replace("\\\n", " ")
    return [shlex.split(line) for line in joined.splitlines() if line]


@pytest.fixture(scope="module")
def robot() -> dict[str, Any]:
    return dict(interpolated()["robot"])


def test_the_image_is_one_release_of_jazzy(instructions: list[list[str]]) -> None:
    name, image = instructions[0]
    assert name == "FROM"
    assert re.fullmatch(r"ros:jazzy-ros-base-noble@sha256:[0-9a-f]{64}", image)


def test_the_image_does_not_run_as_root(instructions: list[list[str]]) -> None:
    names = [words[0] for words in instructions]
    assert instructions[names.index("USER")] == ["USER", "1000:1000"]
    assert names.index("USER") > max(i for i, name in enumerate(names) if name in {"RUN", "COPY"})


def test_nobody_in_it_becomes_root() -> None:
    for service in interpolated().values():
        assert service["user"] == "1000:1000"
        assert service["cap_drop"] == ["ALL"]
        assert service["security_opt"] == ["no-new-privileges:true"]
        assert "privileged" not in service


def test_what_is_copied_is_there(instructions: list[list[str]]) -> None:
    sources = _sources(instructions)
    assert sources
    for source in sources:
        assert (ROOT / source).exists(), source


def test_what_is_copied_is_in_the_context(instructions: list[list[str]]) -> None:
    lines = (DOCKER / "Dockerfile.dockerignore").read_text().split()
    assert lines[0] == "*"
    kept = {line[1:] for line in lines if line.startswith("!")}
    assert {source.partition("/")[0] for source in _sources(instructions)} == kept


def test_the_distribution_can_be_built_from_it(instructions: list[list[str]]) -> None:
    pyproject = (ROOT / "pyproject.toml").read_text()
    packages = re.search(r"^wheel\.packages = \[(.*)\]$", pyproject, re.MULTILINE)
    assert packages
    needed = {"pyproject.toml", "README.md", "LICENSE", "firmware"}
    needed |= {name.partition("/")[0] for name in re.findall(r'"([^"]+)"', packages[1])}
    assert needed <= set(_sources(instructions))


def test_what_runs_in_it_was_put_there(
    instructions: list[list[str]], robot: dict[str, Any]
) -> None:
    put = {words[-1] for words in instructions if words[0] == "COPY"}
    (entrypoint,) = [words for words in instructions if words[0] == "ENTRYPOINT"]
    assert yaml.safe_load(" ".join(entrypoint[1:])) == ["/entrypoint.sh"]
    check = robot["healthcheck"]["test"]
    assert check[0] == "CMD"
    assert check[1:-1] == ["/entrypoint.sh", "python3", "/healthcheck.py"]
    assert {"/entrypoint.sh", "/healthcheck.py"} <= put
    assert (DOCKER / "entrypoint.sh").stat().st_mode & stat.S_IXUSR


def test_the_context_is_the_repository(robot: dict[str, Any]) -> None:
    context = (DOCKER / robot["build"]["context"]).resolve()
    assert context == ROOT
    assert context / robot["build"]["dockerfile"] == DOCKER / "Dockerfile"


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
    robot = interpolated(NAMESPACE="robot1", FRAME_PREFIX="robot1")["robot"]
    assert {"namespace:=robot1", "frame_prefix:=robot1"} <= set(robot["command"])
    assert robot["healthcheck"]["test"][-1] == "robot1/hardware_robot"


def test_a_slash_is_no_prefix_and_no_namespace(robot: dict[str, Any]) -> None:
    given = dict(argument.split(":=") for argument in robot["command"] if ":=" in argument)
    nodes = started(load(PACKAGE / "launch" / "hardware_bringup.launch.py"), **given)
    assert {node.namespace for node in nodes.values()} == {"/"}
    assert "tf_frame_prefix" not in nodes["hardware_robot"].parameters[1]
    assert robot["healthcheck"]["test"][-1] == "/hardware_robot"


def test_the_middleware_can_be_chosen(instructions: list[list[str]]) -> None:
    services = interpolated(RMW_IMPLEMENTATION="rmw_zenoh_cpp")
    for service in services.values():
        assert service["environment"]["RMW_IMPLEMENTATION"] == "rmw_zenoh_cpp"
    default = interpolated()["robot"]["environment"]["RMW_IMPLEMENTATION"]
    installed = {word for words in instructions if words[0] == "RUN" for word in words}
    assert {"ros-jazzy-rmw-zenoh-cpp", "ros-jazzy-rmw-cyclonedds-cpp"} <= installed
    assert default == "rmw_fastrtps_cpp", "the image has it"
    router = services["zenoh-router"]
    assert router["profiles"] == ["zenoh"], "only if it is asked for"
    assert router["command"] == ["ros2", "run", "rmw_zenoh_cpp", "rmw_zenohd"]
    assert router["image"] == services["robot"]["image"]


def test_every_variable_is_explained() -> None:
    head, services = COMPOSE.read_text().split("services:", 1)
    used = set(re.findall(r"\$\{(\w+):-", services))
    assert used == set(re.findall(r"\b[A-Z]+(?:_[A-Z]+)*\b", head)) & used
    page = (ROOT / "docs" / "ros.md").read_text()
    assert {name for name in used if f"`{name}" not in page} == set()


def test_devices_can_come_back(robot: dict[str, Any]) -> None:
    assert "/dev:/dev" in robot["volumes"]
    allowed = [re.fullmatch(r"c (\d+):\* rwm?", rule) for rule in robot["device_cgroup_rules"]]
    assert {rule[1] for rule in allowed if rule} == {TTY_USB, TTY_ACM, TTY_AMA}
    assert len(allowed) == 3


def test_it_is_restarted_and_ends_in_order(robot: dict[str, Any]) -> None:
    assert robot["restart"] == "unless-stopped"
    assert robot["stop_signal"] == "SIGINT"


def test_other_nodes_reach_it(robot: dict[str, Any]) -> None:
    """Discovery, and Fast DDS's shared memory, which needs the same user on both sides."""
    assert (robot["network_mode"], robot["ipc"]) == ("host", "host")
    assert robot["user"].partition(":")[0] not in {"", "0", "root"}


def test_the_health_check_has_the_time_it_takes(robot: dict[str, Any]) -> None:
    source = (DOCKER / "healthcheck.py").read_text()
    check_timeout = re.search(r"^TIMEOUT_S = ([\d.]+)$", source, re.MULTILINE)
    assert check_timeout
    timeout = robot["healthcheck"]["timeout"]
    assert float(check_timeout[1]) < float(timeout.removesuffix("s"))


def _sources(instructions: list[list[str]]) -> list[str]:
    """What COPY takes from the context."""
    copies = [[w for w in words if not w.startswith("--")] for words in instructions]
    return [source for words in copies if words[0] == "COPY" for source in words[1:-1]]
