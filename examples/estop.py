"""Drive, and handle an e-stop and a lost link: python examples/estop.py /dev/ttyUSB0.

The device stops by itself. The program only has to notice it, wait for a person and clear the
e-stop, which the device refuses while the cause is present.
"""

from __future__ import annotations

import argparse
import sys
import time

import wheelwire

ROBOT = "a port, a YAML file, mock, ...; default: $WHEELWIRE_ROBOT"


def wait_for_release(robot: wheelwire.Robot) -> None:
    """Ask the user until the e-stop can be cleared."""
    while True:
        input("e-stop: release the button, look around, then press Enter ")
        try:
            robot.clear_estop()
        except wheelwire.DeviceRefused as refused:
            print(f"not yet: {refused}")
        else:
            robot.set_velocity(0.0, 0.0)  # a clear alone restarts nothing
            print("cleared; driving again")
            return


def main() -> None:
    """Drive forward for some seconds, not counting an e-stop or a lost link."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", nargs="?", help=ROBOT)
    parser.add_argument("--seconds", type=float, default=5.0)
    arguments = parser.parse_args()

    with wheelwire.connect(arguments.robot) as robot:
        driven_s = 0.0
        while driven_s < arguments.seconds:
            try:
                robot.set_velocity(0.2, 0.0, ttl=0.3)
            except wheelwire.DeviceRefused as refused:
                if refused.code != wheelwire.RefusalCode.ESTOPPED:
                    raise  # a fault: its message names the cause
                wait_for_release(robot)
            except wheelwire.LinkLost as lost:
                print(f"waiting: {lost}")  # the driver opens the port again by itself
            else:
                driven_s += 0.05
            time.sleep(0.05)
    print("done")


if __name__ == "__main__":
    try:
        main()
    except wheelwire.WheelwireError as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("interrupted; the robot was stopped")
