"""The executable: `hardware_robot`, or `python -m wheelwire_ros`."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the node; somebody may interrupt it while its modules are still being read."""
    try:
        from .hardware_robot import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(0)  # no robot is open yet: from rclpy's start on it takes the signal itself


if __name__ == "__main__":
    main()
