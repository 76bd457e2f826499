"""Sends signals at random moments to a program that uses a robot, and checks its calls."""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from wheelwire_protocol.types import ParameterSet, SetDuty, Stop

from .core_device import CoreDevice
from .processes import talking
from .pty_device import PtyDevice

PROGRAM = Path(__file__).with_name("interrupted_host.py")
LONGEST_PAUSE_S = 0.0015
TIMEOUT_S = 600.0


@dataclass
class Interruptions:
    """The results of many signals."""

    report: dict[str, Any]
    unsent: list[str]
    """Calls that reported success although the device never received their message."""


def interrupt_program(count: int, mode: str, seed: int = 1) -> Interruptions:
    """Interrupt a program `count` times; see `interrupted_host`."""
    arguments = (seed, count, mode)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with (
        tempfile.TemporaryDirectory() as folder,
        PtyDevice(Path(folder) / "robot", CoreDevice(ttl_max_s=5.0)) as robot,
        ThreadPoolExecutor(1) as pool,
        talking(sys.executable, PROGRAM, robot.path, *arguments, env=environment) as (
            process,
            line,
        ),
    ):
        assert line == "ready\n"
        assert process.stdout is not None
        # Read while it runs: the report is longer than a pipe holds.
        report = pool.submit(process.stdout.read)
        moments, end = random.Random(seed), time.monotonic() + TIMEOUT_S
        while not report.done():
            assert time.monotonic() < end, "the program hangs"
            process.send_signal(signal.SIGINT)
            time.sleep(moments.uniform(0, LONGEST_PAUSE_S))
        told = json.loads(report.result())
        return Interruptions(told, _unsent(told, robot))


def _unsent(report: dict[str, Any], robot: PtyDevice) -> list[str]:
    received = robot.device.received
    duties = {m.left_duty_q15 for m in received if isinstance(m, SetDuty)}
    values = {round(m.value, 4) for m in received if isinstance(m, ParameterSet)}
    stops = sum(isinstance(message, Stop) for message in received)
    unsent = [f"duty {duty}" for duty in report["duties"] if duty not in duties]
    unsent += [f"value {value}" for value in report["values"] if value not in values]
    missing = cast("int", report["stops"]) - stops
    return unsent + ["stop"] * max(0, missing)
