"""Values of parameters: the user's values at the start, and whether values are right.

A check returns None, or what is wrong with a value and what to write instead.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from difflib import get_close_matches
from typing import Any, NamedTuple

from rclpy.parameter import Parameter

Check = Callable[[Any], str | None]
Get = Callable[[str], Any]
"""Returns the value of a parameter by its name."""

ALIASES = {
    "serial_port": "port",
    "wheel_base": "wheel_separation",
    "cpr": "counts_per_revolution",
    "max_speed": "max_velocity_mps",
    "pwm_frequency": "pwm_frequency_hz",
    "left_wheel_name": "left_wheel_names",
    "right_wheel_name": "right_wheel_names",
}
"""Other names, from other packages and previous releases. The node reads them at the start, and
never lists them."""

_Type = Parameter.Type


class Disagreement(NamedTuple):
    """Parameters that are valid each by itself, but not together."""

    names: tuple[str, ...]
    reason: str


def variances(values: Sequence[float]) -> str | None:
    """One finite variance for each of x, y, z, roll, pitch and yaw."""
    if len(values) != 6:
        return f"it has {len(values)} numbers: write six, for x, y, z, roll, pitch and yaw"
    if not all(math.isfinite(value) and value >= 0 for value in values):
        return "a variance is a finite number of at least 0"
    return None


def frame(name: str) -> str | None:
    """A frame's name."""
    return None if name.strip("/ ") else "a frame has a name: odom and base_link are usual"


def wheel_names(names: Sequence[str]) -> str | None:
    """Refuses an empty list, and an empty name."""
    if not names or not all(name.strip() for name in names):
        return "write at least one name, as in the URDF, and no empty one"
    return None


def command_timeout(seconds: float) -> str | None:
    """A command must end."""
    if seconds == 0:
        return "every command must expire: write a time in seconds, 0.02 to 5.0"
    return None


def _limit(bound: str, allows: Callable[[float], bool]) -> Check:
    """A limit on one side of zero; NaN for none."""

    def check(value: float) -> str | None:
        if math.isnan(value) or (math.isfinite(value) and allows(value)):
            return None
        return f"write a number {bound} 0.0, or .NAN for no limit"

    return check


at_least_zero = _limit("of at least", lambda value: value >= 0)
at_most_zero = _limit("of at most", lambda value: value <= 0)
above_zero = _limit("above", lambda value: value > 0)


def only(accepted: Any, instead: str) -> Check:
    """A parameter of another package, and the one value that is accepted."""

    def check(value: Any) -> str | None:
        return None if same(value, accepted) else instead

    return check


def one_of(*choices: str) -> Check:
    """A parameter with a few possible values."""

    def check(value: Any) -> str | None:
        return None if value in choices else f"write one of {', '.join(choices)}"

    return check


def same(a: Any, b: Any) -> bool:
    """Whether two values are equal as the robot stores them, in 32 bits; NaN equals NaN."""
    if isinstance(a, int | float) and isinstance(b, int | float):
        # A 32-bit float is off by up to 6e-8 of its value.
        return (math.isnan(a) and math.isnan(b)) or math.isclose(a, b, rel_tol=1e-6)
    if _is_list(a) and _is_list(b):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


def _is_list(value: Any) -> bool:
    return not isinstance(value, str) and hasattr(value, "__len__")  # an array is not a Sequence


def disagreements(get: Get) -> Iterator[Disagreement]:
    """The parameters that contradict each other."""
    if get("odom_frame_id").strip("/") == get("base_frame_id").strip("/"):
        yield Disagreement(
            ("odom_frame_id", "base_frame_id"), "they are equal: a frame cannot be its own parent"
        )
    left, right = list(get("left_wheel_names")), list(get("right_wheel_names"))
    if len(left) != len(right):
        yield Disagreement(
            ("left_wheel_names", "right_wheel_names"),
            f"{len(left)} wheels on the left and {len(right)} on the right: name as many",
        )
    twice = [name for name, count in Counter(left + right).items() if count > 1]
    if twice:
        yield Disagreement(
            ("left_wheel_names", "right_wheel_names"), f"{', '.join(twice)}: named more than once"
        )
    empty_v, full_v = get("battery_empty_v"), get("battery_full_v")
    battery = ("battery_empty_v", "battery_full_v")
    if math.isnan(empty_v) != math.isnan(full_v):
        yield Disagreement(battery, "one is given without the other: give both, or .NAN for both")
    elif empty_v >= full_v:
        yield Disagreement(battery, f"empty at {empty_v:g} V, full at {full_v:g} V: swap them")
    timeout_s, longest_s = get("cmd_vel_timeout"), get("ttl_max_s")
    if longest_s is not None and timeout_s > longest_s and not same(timeout_s, longest_s):
        yield Disagreement(
            ("cmd_vel_timeout", "ttl_max_s"),
            f"a command of {timeout_s:g} s is longer than the robot allows, "
            f"{longest_s:g} s: lower cmd_vel_timeout, or raise ttl_max_s",
        )
    if get("wheels_per_side") not in {0, len(left)}:
        yield Disagreement(
            ("wheels_per_side", "left_wheel_names"),
            f"wheels_per_side is {get('wheels_per_side')}, but left_wheel_names has {len(left)}: "
            "leave out wheels_per_side",
        )


def start_values(node: Any, names: Collection[str]) -> tuple[dict[str, Parameter], dict[str, str]]:
    """The user's values for a node with declared parameters, with other names resolved.

    Args:
        node: An rclpy node.
        names: Its parameters, except those that rclpy declares and sets itself.

    Returns:
        The values by the parameters' own names, and what is wrong with each parameter that has two
        different values under two names.
    """
    # rclpy has no public access to what was given for parameters that are not declared.
    given: dict[str, Parameter] = node._parameter_overrides
    values: dict[str, Parameter] = {}
    conflicts: dict[str, str] = {}
    own = [(name, name) for name in given if name in names]
    others = [(name, alias) for alias, name in ALIASES.items() if alias in given and name in names]
    for name, given_as in own + others:
        adapted = _adapt(name, given[given_as], _Type(node.describe_parameter(name).type))
        other = values.setdefault(name, adapted)
        # Equal ones do not conflict: one file may serve this node and another package's.
        if not (other.type_ == adapted.type_ and same(other.value, adapted.value)):
            conflicts[name] = (
                f"{given_as} is another name of {name}, and they differ "
                f"({adapted.value} and {other.value}): give only one of them"
            )
        if given_as != name:
            node.get_logger().info(f"parameter {given_as} is read as {name}")
    _warn_of_unknown(node, given)
    return values, conflicts


def _adapt(name: str, parameter: Parameter, expected: Any) -> Parameter:
    """The parameter with its value as the declared type; unchanged where that loses something."""
    type_, value = parameter.type_, parameter.value
    # YAML takes a number without a point for an integer, and rclpy never converts.
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
    """Warn of undeclared parameters: rclpy ignores them, so a typo would go unnoticed.

    This is not an error, because a file for `/**` may have parameters of other nodes.
    """
    known = [*node._parameters, *ALIASES]
    unknown = [
        name + "".join(f" (did you mean {near}?)" for near in get_close_matches(name, known, n=1))
        for name in sorted(given)
        if name not in known
    ]
    if unknown:
        node.get_logger().warning(f"unknown parameters, ignored: {', '.join(unknown)}")
