"""The image and the compose file, as far as they can be checked without Docker."""

from __future__ import annotations

import re
import shlex
import stat
from pathlib import Path
from typing import Any

import pytest
import yaml

from support.launch_stand_in import arguments, load

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "ros_node"
DOCKER = PACKAGE / "docker"
TTY_USB, TTY_ACM = "188", "166"
"""Major numbers of the kernel's devices.txt."""


@pytest.fixture(scope="module")
def instructions() -> list[list[str]]:
    text = (DOCKER / "Dockerfile").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    joined = "\n".join(lines).replace("\\\n", " ")
    return [shlex.split(line) for line in joined.splitlines() if line]


@pytest.fixture(scope="module")
def robot() -> dict[str, Any]:
    compose = yaml.safe_load((DOCKER / "docker-compose.pi.yml").read_text())
    (service,) = compose["services"].values()
    return dict(service)


def test_the_image_is_jazzy(instructions: list[list[str]]) -> None:
    assert instructions[0] == ["FROM", "ros:jazzy"]


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
    assert {"/entrypoint.sh", "/healthcheck.py"} == {w for w in check if w.startswith("/")} <= put
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
    assert values["params_file"] == f"{mounts['../config']}/pi4b_params.yaml"


def test_devices_can_come_back(robot: dict[str, Any]) -> None:
    assert "/dev:/dev" in robot["volumes"]
    allowed = [re.fullmatch(r"c (\d+):\* rwm?", rule) for rule in robot["device_cgroup_rules"]]
    assert {rule[1] for rule in allowed if rule} == {TTY_USB, TTY_ACM}
    assert len(allowed) == 2


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
