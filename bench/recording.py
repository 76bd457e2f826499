"""Recording.

A simulator sends {STREAM_HZ} states a second to a program that sends a setpoint and reads a sample
{LOOP_HZ} times a second, at first unrecorded, then recorded. CPU is the program's, of one core.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress

from harness import Report, run
from support.load import load_while
from support.soak import resident_kib
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import Expired, LinkLost, RequestTimeout
from wheelwire.simulation.simulator import Simulator

STREAM_HZ = 1000
LOOP_HZ = 50
"""Rate of the program's loop: a setpoint and a sample each."""
SETTLING_S = 3.0
GROWTH_KIB = 16 * 1024
"""A file's index waits in memory for its end: some KiB a second, for an hour at most."""


def drive(robot: SerialDriver, seconds: float) -> None:
    """Back and forth, as a program with a control loop does."""
    begin = time.monotonic()
    while (passed_s := time.monotonic() - begin) < seconds:
        # A computer that stands still for a second loses the link, too, or lets a setpoint expire:
        # the link opens again by itself, and the next setpoint is a new one.
        with suppress(Expired, LinkLost, RequestTimeout):
            robot.set_velocity(0.2 if passed_s % 20 < 10 else -0.2, 0.1, ttl=0.5)
            robot.read()
        time.sleep(1 / LOOP_HZ)


def main(report: Report, *, minutes: float = 1.0) -> None:
    """Measure and print."""
    seconds = minutes * 60
    with Simulator() as simulator, SerialDriver(simulator.port, stream_rate_hz=STREAM_HZ) as robot:
        drive(robot, SETTLING_S)
        plain = load_while(lambda: drive(robot, seconds)).cpu
        recorder = robot.record(report.scratch / "day.mcap")
        drive(robot, SETTLING_S)
        resident = resident_kib(os.getpid())
        recorded = load_while(lambda: drive(robot, seconds)).cpu
        growth = resident_kib(os.getpid()) - resident
        recorder.close()
        size_mb = sum(file.stat().st_size for file in report.scratch.glob("*.mcap")) / 1e6
    report.say(
        f"In {minutes:g} min: {plain:.1%} unrecorded, {recorded:.1%} recorded, "
        f"{1e6 * (recorded - plain) / STREAM_HZ:.0f} us a state; "
        f"{size_mb / (seconds + SETTLING_S) * 3600:.0f} MB an hour."
    )
    report.equal("records lost", recorder.lost, 0)
    report.at_most("growth while recorded", growth, GROWTH_KIB, " KiB")


run(main)
