"""The executable `hardware_robot`: the node of a robot, with any of Wheelwire's drivers."""

from __future__ import annotations

import signal
import sys
import threading
from itertools import pairwise

import rclpy
from rclpy.exceptions import NotInitializedException, ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.signals import uninstall_signal_handlers

from .node import Finalized, HardwareRobot

FILE_OPTION = "--params-file"


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted; however it ends, the wheels stop first."""
    rclpy_has_signals = threading.Event()

    def interrupt(*_: object) -> None:
        # From then on rclpy ends its context. It calls this handler as well: an exception would
        # have this thread destroy the executors before rclpy has woken them all.
        if not rclpy_has_signals.is_set():
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    try:
        problem = _init(args)
        rclpy_has_signals.set()
        _run(problem)
    except (KeyboardInterrupt, ExternalShutdownException, Finalized):
        return
    except ParameterException as error:
        sys.exit(f"hardware_robot: {error}")
    except (RuntimeError, NotInitializedException):
        if rclpy.ok():
            raise
        # A signal between two of its steps ends rclpy's context, and the next step then fails.
    finally:
        rclpy.try_shutdown()


def _run(problem: str) -> None:
    node = None
    try:
        node = HardwareRobot(problem)
        node.spin()
    finally:
        # At a signal, a thread of rclpy wakes each executor, even one that is being destroyed
        # here: a segmentation fault. This waits until that thread has ended.
        uninstall_signal_handlers()
        if node is not None:
            node.close()


def _init(args: list[str] | None) -> str:
    """Initialise rclpy; returns why the parameter files cannot be read, or nothing.

    Without them the node starts nevertheless, to say so: it would only be restarted if it ended.
    """
    given = sys.argv if args is None else args
    try:
        rclpy.init(args=given)
    except RuntimeError as error:
        # Only the text tells this error from rclpy's others.
        if "params file" not in str(error):
            raise
        pairs = pairwise(["", *given])
        # Without `--params-file` and what follows it.
        rclpy.init(args=[one for before, one in pairs if FILE_OPTION not in (before, one)])
        return (
            f"{' '.join(str(error).split())}: a ROS parameter file has its values below `/**:` and "
            "`ros__parameters:`; a file for wheelwire.open_robot is different"
        )
    return ""


if __name__ == "__main__":
    main()
