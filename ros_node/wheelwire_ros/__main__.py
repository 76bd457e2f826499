"""The executable: `hardware_robot`, or `python -m wheelwire_ros`."""

from __future__ import annotations

import signal
import sys
from typing import NoReturn


def main() -> None:
    """Run the node; somebody may interrupt it while its modules are still being read."""
    interrupts: list[int] = []

    def interrupt(number: int, _: object) -> NoReturn:
        interrupts.append(number)
        raise KeyboardInterrupt

    def report(unraisable: sys.UnraisableHookArgs) -> None:
        if unraisable.exc_type is not KeyboardInterrupt:
            sys.__unraisablehook__(unraisable)

    signal.signal(signal.SIGINT, interrupt)
    # Python ignores an exception in a callback of its own, such as that of an import's lock, and
    # prints it.
    sys.unraisablehook = report
    try:
        from .hardware_robot import main as run

        if not interrupts:
            sys.unraisablehook = sys.__unraisablehook__
            run()
    except KeyboardInterrupt:
        sys.exit(0)  # no robot is open yet: from rclpy's start on it takes the signal itself


if __name__ == "__main__":
    main()
