"""Checks of ROS: whether this terminal and the nodes that run here hear each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from .finding import Finding
from .machine import Machine, Process

_DEFAULTS = {
    "ROS_DOMAIN_ID": "0",
    "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    "ROS_LOCALHOST_ONLY": "0",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
}


def mismatch(machine: Machine) -> Iterator[Finding]:
    """Differing variables keep this terminal and a running node apart."""
    ours = _settings(machine.environment)
    if ours is None:
        return
    for process in machine.processes:
        theirs = _settings(machine.environment_of(process)) if _is_node(process) else None
        if theirs is None:
            continue
        for name in _DEFAULTS:
            if theirs[name] != ours[name]:
                yield Finding(
                    "ros-mismatch",
                    f"the ROS node {process.pid} has {name}={theirs[name]}, this terminal "
                    f"{ours[name]}: they do not hear each other.",
                    f"export {name}={theirs[name]}; then ros2 daemon stop",
                )


def _is_node(process: Process) -> bool:
    return any(a == "--ros-args" or "/wheelwire_ros/" in a for a in process.arguments)


def _settings(environment: Mapping[str, str]) -> dict[str, str] | None:
    """The variables that decide which nodes hear each other; None outside ROS."""
    if not environment.get("ROS_DISTRO"):
        return None
    return {name: environment.get(name) or default for name, default in _DEFAULTS.items()}


CHECKS = (mismatch,)
