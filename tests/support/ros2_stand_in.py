"""`ros2 launch` as far as the node: `-m support.ros2_stand_in launch wheelwire_ros FILE ...`.

It reads the launch file with `launch_stand_in`, and becomes the node hardware_robot as that wants
it started. The other nodes are not started.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from support.launch_stand_in import Node, load, started

PACKAGE = Path(__file__).parents[2] / "ros_node"


def arguments(node: Node) -> list[str]:
    """Of the node's executable, as launch_ros gives them."""
    found = [*node.arguments, "--ros-args", "-r", f"__node:={node.name}"]
    if node.namespace:
        found += ["-r", f"__ns:={node.namespace}"]
    for name, other in node.remappings:
        found += ["-r", f"{name}:={other}"]
    for parameters in node.parameters:
        if isinstance(parameters, dict):
            for name, value in parameters.items():
                text = str(value).lower() if isinstance(value, bool) else f"{value!r}"
                found += ["-p", f"{name}:={text}"]
        else:
            found += ["--params-file", str(parameters)]
    return found


def main() -> None:
    verb, package, file, *given = sys.argv[1:]
    assert (verb, package) == ("launch", "wheelwire_ros")
    values = dict(one.split(":=", 1) for one in given)
    nodes = started(load(PACKAGE / "launch" / file), **values)
    program = [sys.executable, "-m", "wheelwire_ros.hardware_robot"]
    os.execv(sys.executable, [*program, *arguments(nodes["hardware_robot"])])  # noqa: S606


if __name__ == "__main__":
    main()
