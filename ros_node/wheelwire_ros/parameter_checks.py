"""Which values the node's parameters may have, beyond type and range. Needs no rclpy.

A check returns None, or what is wrong with a value and what to write instead.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

Check = Callable[[Any], str | None]
Get = Callable[[str], Any]
"""Returns the value of a parameter by its name."""

AXES = 6
"""x, y, z, roll, pitch, yaw."""


class Disagreement(NamedTuple):
    """Parameters that are valid each by itself, but not together."""

    names: tuple[str, ...]
    reason: str


def anything(_value: Any) -> str | None:
    """No check."""
    return None


def variances(values: Sequence[float]) -> str | None:
    """One finite variance for each of x, y, z, roll, pitch and yaw."""
    if len(values) != AXES:
        return f"it has {len(values)} numbers: write six, for x, y, z, roll, pitch and yaw"
    if not all(math.isfinite(value) and value >= 0 for value in values):
        return "a variance is a finite number of at least 0"
    return None


def frame(name: str) -> str | None:
    """A frame's name."""
    return None if name.strip("/ ") else "a frame has a name: odom and base_link are usual"


def wheel_names(names: Sequence[str]) -> str | None:
    """At least one name, none empty."""
    if not names or not all(name.strip() for name in names):
        return "write at least one name, as in the URDF, and none that is empty"
    return None


def command_timeout(seconds: float) -> str | None:
    """A command must end."""
    if seconds == 0:
        return "a command without an end is not offered: write its life in seconds, 0.02 to 5.0"
    return None


def at_least_zero(value: float) -> str | None:
    """An upper limit; NaN for none."""
    if math.isnan(value) or 0 <= value < math.inf:
        return None
    return "write a number of at least 0.0, or .NAN for no limit"


def at_most_zero(value: float) -> str | None:
    """A lower limit; NaN for none."""
    if math.isnan(value) or -math.inf < value <= 0:
        return None
    return "write a number of at most 0.0, or .NAN for no limit"


def above_zero(value: float) -> str | None:
    """A limit that leaves some motion; NaN for none."""
    if math.isnan(value) or 0 < value < math.inf:
        return None
    return "write a number above 0.0, or .NAN for no limit"


def only(accepted: Any, instead: str) -> Check:
    """A parameter of another package of which one value is accepted."""

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
    if _is_number(a) and _is_number(b):
        # A 32-bit float is off by up to 6e-8 of its value.
        return (math.isnan(a) and math.isnan(b)) or math.isclose(a, b, rel_tol=1e-6)
    if _is_list(a) and _is_list(b):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


def exceeds(value: float, limit: float) -> bool:
    """Whether a value is above a limit as the robot stores it."""
    return value > limit and not same(value, limit)


def _is_number(value: Any) -> bool:
    # To Python a bool is an int, to ROS it is another type.
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_list(value: Any) -> bool:
    return not isinstance(value, str) and hasattr(value, "__len__")  # an array is no Sequence


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
    longest_s = get("ttl_max_s")
    if longest_s is not None and exceeds(get("cmd_vel_timeout"), longest_s):
        yield Disagreement(
            ("cmd_vel_timeout", "ttl_max_s"),
            f"a command of {get('cmd_vel_timeout'):g} s lives longer than the robot lets one, "
            f"{longest_s:g} s: lower cmd_vel_timeout, or raise ttl_max_s",
        )
    if get("wheels_per_side") not in {0, len(left)}:
        yield Disagreement(
            ("wheels_per_side", "left_wheel_names"),
            f"wheels_per_side is {get('wheels_per_side')}, but left_wheel_names has {len(left)}: "
            "leave out wheels_per_side",
        )
