"""A minimal stand-in for ROS's launch and launch_ros, to see what a launch file would start.

Neither is on PyPI. Anything else that a file uses raises an error, so that nothing is missed.
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import yaml


@dataclass
class LaunchContext:
    launch_configurations: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class LaunchConfiguration:
    variable_name: str

    def perform(self, context: LaunchContext) -> str:
        return context.launch_configurations[self.variable_name]


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: str = field(kw_only=True)
    description: str = field(kw_only=True)
    choices: list[str] | None = field(default=None, kw_only=True)


@dataclass
class OpaqueFunction:
    function: Callable[[LaunchContext], list[Node | LogInfo]] = field(kw_only=True)


@dataclass(frozen=True)
class IfCondition:
    predicate: LaunchConfiguration

    def holds(self, context: LaunchContext) -> bool:
        value = self.predicate.perform(context).strip().lower()
        return {"true": True, "1": True, "false": False, "0": False}[value]


@dataclass(frozen=True)
class ParameterValue:
    value: Any
    value_type: type = field(kw_only=True)


@dataclass(kw_only=True)
class Node:
    package: str
    executable: str
    name: str | None = None
    namespace: Any = None
    parameters: list[Any] = field(default_factory=list)
    remappings: list[tuple[str, str]] = field(default_factory=list)
    arguments: list[Any] = field(default_factory=list)
    output: str = "log"
    respawn: bool = False
    respawn_delay: float | None = None
    condition: IfCondition | None = None


@dataclass
class LaunchDescription:
    entities: list[DeclareLaunchArgument | OpaqueFunction | Node]


@dataclass
class LogInfo:
    msg: str = field(kw_only=True)


class PackageNotFoundError(KeyError):
    """As ament_index_python's."""


installed = {"rplidar_ros", "robot_state_publisher", "wheelwire_ros"}
"""The packages of the imagined ROS installation; a test may take one away."""


def get_package_prefix(package_name: str) -> str:
    if package_name not in installed:
        raise PackageNotFoundError(package_name)
    return "/opt/ros/jazzy"


MODULES: dict[str, list[Any]] = {
    "ament_index_python": [],
    "ament_index_python.packages": [PackageNotFoundError, get_package_prefix],
    "launch": [LaunchContext, LaunchDescription],
    "launch.actions": [DeclareLaunchArgument, LogInfo, OpaqueFunction],
    "launch.conditions": [IfCondition],
    "launch.substitutions": [LaunchConfiguration],
    "launch_ros": [],
    "launch_ros.actions": [Node],
    "launch_ros.parameter_descriptions": [ParameterValue],
}


def load(file: Path) -> LaunchDescription:
    """What a launch file describes."""
    modules = {name: ModuleType(name) for name in MODULES}
    for name, contents in MODULES.items():
        vars(modules[name]).update({item.__name__: item for item in contents})
    with patch.dict(sys.modules, modules):
        description = runpy.run_path(str(file))["generate_launch_description"]()
    assert isinstance(description, LaunchDescription)
    return description


def arguments(description: LaunchDescription) -> dict[str, DeclareLaunchArgument]:
    """Those that a launch file takes."""
    declared = [e for e in description.entities if isinstance(e, DeclareLaunchArgument)]
    return {argument.name: argument for argument in declared}


def started(description: LaunchDescription, **given: str) -> dict[str, Node]:
    """The nodes that these arguments start, by their executable, with all substitutions done."""
    declared = arguments(description)
    for name, value in given.items():
        choices = declared[name].choices
        assert choices is None or value in choices
    values = {name: given.get(name, one.default_value) for name, one in declared.items()}
    context = LaunchContext(values)
    nodes: list[Node] = []
    for entity in description.entities:
        if isinstance(entity, OpaqueFunction):
            nodes += [found for found in entity.function(context) if isinstance(found, Node)]
        elif isinstance(entity, Node):
            nodes.append(entity)
    starting = [n for n in nodes if n.condition is None or n.condition.holds(context)]
    return {node.executable: _resolved(node, context) for node in starting}


def _resolved(node: Node, context: LaunchContext) -> Node:
    return replace(
        node,
        namespace=_value(node.namespace, context),
        parameters=[_value(parameter, context) for parameter in node.parameters],
        arguments=[_value(argument, context) for argument in node.arguments],
    )


def _value(value: Any, context: LaunchContext) -> Any:
    if isinstance(value, LaunchConfiguration):
        return value.perform(context)
    if isinstance(value, ParameterValue):
        given = _value(value.value, context)
        return _switch(given) if value.value_type is bool else value.value_type(given)
    if isinstance(value, dict):
        return {name: _value(entry, context) for name, entry in value.items()}
    return value


def _switch(text: str) -> bool:
    """As launch reads it: by YAML, which takes true, True and TRUE."""
    value = yaml.safe_load(text)
    assert isinstance(value, bool)
    return value
