"""The parameters that the user gave at the start: other names resolved, types adapted."""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches
from typing import Any

from rclpy.parameter import Parameter

from . import parameters
from .parameter_checks import same

_Type = Parameter.Type


class StartValues:
    """What was given to a node whose parameters are declared.

    Args:
        node: An rclpy node.
        names: Its parameters, without those that rclpy declares and sets itself.

    Attributes:
        values: By the parameters' own names.
        conflicts: The parameters that were given different values under two names, and these.
    """

    def __init__(self, node: Any, names: Collection[str]) -> None:
        # rclpy has no public access to what was given for parameters that are not declared.
        given: dict[str, Parameter] = node._parameter_overrides
        self.values: dict[str, Parameter] = {}
        self.conflicts: dict[str, str] = {}
        for name, parameter in given.items():
            if name in names:
                self._add(node, name, name, parameter)
        for alias, name in parameters.ALIASES.items():
            if alias in given and name in names:
                self._add(node, name, alias, given[alias])
                node.get_logger().info(f"parameter {alias} is read as {name}")
        _warn_of_unknown(node, given)

    def _add(self, node: Any, name: str, given_as: str, parameter: Parameter) -> None:
        expected = _Type(node.describe_parameter(name).type)
        adapted = _adapt(name, parameter, expected)
        other = self.values.setdefault(name, adapted)
        # Equal ones are no conflict: one file may serve this node and another package's.
        if not (other.type_ == adapted.type_ and same(other.value, adapted.value)):
            self.conflicts[name] = (
                f"{given_as} is another name of {name}, and they differ "
                f"({adapted.value} and {other.value}): give only one of them"
            )


def _adapt(name: str, parameter: Parameter, expected: Any) -> Parameter:
    """The parameter with its value as the declared type; unchanged where that loses something."""
    type_, value = parameter.type_, parameter.value
    # To YAML a number without a point is an integer, and rclpy never converts.
    if (type_, expected) == (_Type.INTEGER, _Type.DOUBLE):
        value = float(value)
    elif (type_, expected) == (_Type.DOUBLE, _Type.INTEGER) and value.is_integer():
        value = int(value)
    elif (type_, expected) == (_Type.INTEGER_ARRAY, _Type.DOUBLE_ARRAY):
        value = [float(number) for number in value]
    elif (type_, expected) == (_Type.STRING, _Type.STRING_ARRAY):
        value = [value]
    elif type_ == _Type.NOT_SET and expected in {_Type.STRING_ARRAY, _Type.DOUBLE_ARRAY}:
        return Parameter(name, expected, [])  # an empty list in YAML has no type
    return Parameter(name, value=value)


def _warn_of_unknown(node: Any, given: dict[str, Parameter]) -> None:
    """Warn of given parameters that nobody declared: rclpy ignores them, so a typo would go unseen.

    Not an error, because a file for `/**` may have parameters of other nodes.
    """
    known = [*node._parameters, *parameters.ALIASES]
    unknown = [
        name + "".join(f" (did you mean {near}?)" for near in get_close_matches(name, known, n=1))
        for name in sorted(given)
        if name not in known
    ]
    if unknown:
        node.get_logger().warning(f"unknown parameters, ignored: {', '.join(unknown)}")
