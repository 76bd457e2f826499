"""Drive by keyboard: python examples/teleop.py /dev/ttyUSB0.

    i forward    , backward    j left    l right    space stop    e e-stop    c clear    q quit

Hold a key to keep driving. A terminal does not report the release of a key, and starts repeating a
held one after half a second: so each key drives for that long, then the setpoint expires.
"""

from __future__ import annotations

import argparse
import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager

import wheelwire

ROBOT = "a port, a YAML file, mock, ...; default: $WHEELWIRE_ROBOT"
TTL_S = 0.6
VELOCITIES = {"i": (0.2, 0.0), ",": (-0.2, 0.0), "j": (0.0, 1.0), "l": (0.0, -1.0)}


@contextmanager
def single_keys() -> Iterator[None]:
    """The terminal gives each key at once, until the end of the block."""
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def act(robot: wheelwire.Robot, key: str) -> None:
    """Do what a key says."""
    if key in VELOCITIES:
        robot.set_velocity(*VELOCITIES[key], ttl=TTL_S)
    elif key == " ":
        robot.stop()
    elif key == "e":
        robot.estop()
    elif key == "c":
        robot.clear_estop()
        robot.clear_fault()
        robot.set_velocity(0.0, 0.0)  # a clear alone restarts nothing


def main() -> None:
    """Take keys until q."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", nargs="?", help=ROBOT)
    arguments = parser.parse_args()

    print(__doc__)
    with wheelwire.connect(arguments.robot) as robot, single_keys():
        while True:
            ready, _, _ = select.select([sys.stdin], [], [], 0.2)
            key = os.read(sys.stdin.fileno(), 1).decode(errors="replace") if ready else ""
            if key == "q":
                return
            try:
                act(robot, key)
                sample = robot.read()
            except wheelwire.WheelwireError as error:
                print(f"\r{error}")  # an e-stop, a fault, or the link: what to do is in it
                continue
            print(
                f"\r{sample.state.name:9} left {sample.left_mps:+.2f} m/s, "
                f"right {sample.right_mps:+.2f} m/s ",
                end="",
                flush=True,
            )


if __name__ == "__main__":
    try:
        main()
    except wheelwire.WheelwireError as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("interrupted; the robot was stopped")
