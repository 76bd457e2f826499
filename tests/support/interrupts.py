"""Sends signals at random moments to a program that uses a robot, and checks its calls."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from wheelwire_protocol.types import ParameterSet, SetDuty, Stop

from .core_device import CoreDevice
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
    with (
        tempfile.TemporaryDirectory() as folder,
        PtyDevice(Path(folder) / "robot", CoreDevice(ttl_max_s=5.0)) as robot,
        subprocess.Popen(
            [sys.executable, str(PROGRAM), str(robot.path), str(seed), str(count), mode],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            stdout=subprocess.PIPE,
            text=True,
        ) as process,
        ThreadPoolExecutor(1) as pool,
    ):
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            # Read while it runs: the report is longer than a pipe holds.
            report = pool.submit(process.stdout.read)
            _shoot(process, random.Random(seed), report)
        finally:
            process.kill()
        told = json.loads(report.result())
        return Interruptions(told, _unsent(told, robot))


def _shoot(process: subprocess.Popen[str], moments: random.Random, report: Future[str]) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not report.done():
        assert time.monotonic() < end, "the program hangs"
        process.send_signal(signal.SIGINT)
        time.sleep(moments.uniform(0, LONGEST_PAUSE_S))


def _unsent(report: dict[str, Any], robot: PtyDevice) -> list[str]:
    received = robot.device.received
    duties = {m.left_duty_q15 for m in received if isinstance(m, SetDuty)}
    values = {round(m.value, 4) for m in received if isinstance(m, ParameterSet)}
    stops = sum(isinstance(message, Stop) for message in received)
    unsent = [f"duty {duty}" for duty in report["duties"] if duty not in duties]
    unsent += [f"value {value}" for value in report["values"] if value not in values]
    missing = cast("int", report["stops"]) - stops
    return unsent + ["stop"] * max(0, missing)
