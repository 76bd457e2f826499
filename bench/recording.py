"""Recording.

Two pairs of a simulator, which sends {STREAM_HZ} states a second, and a program that sends a
setpoint and reads a sample {LOOP_HZ} times a second; one pair is recorded. CPU is the program's,
of one core; *growth* is its memory's over the last two thirds. *Lost* counts frames and records;
*sessions* beyond the first are moments when the computer stood still.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from harness import Report, run
from support.load import frames_lost, load_while
from support.soak import resident_kib
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import Expired, LinkLost, RequestTimeout
from wheelwire.log.reader import records
from wheelwire.log.rerun import Rerun
from wheelwire.simulation.simulator import Simulator

STREAM_HZ = 1000
LOOP_HZ = 50
"""Rate of the program's loop: a setpoint and a sample each."""
SETTLING_S = 3.0
GROWTH_KIB = 16 * 1024
"""A file's index waits in memory for its end: some KiB a second, for an hour at most."""


@dataclass
class Run:
    """What one program has measured of itself."""

    cpu: float
    frames: int
    lost: int
    growth_kib: int
    sessions: int
    records_lost: int = 0
    frames_counted: tuple[int, int] = (0, 0)
    """At least and at most, while it was recorded."""
    lost_counted: int = 0
    file_bytes: int = 0


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


def program(seconds: float, file: str) -> Run:
    """Drive a robot, and measure what that takes: the main function of a process."""
    with (
        Simulator() as simulator,
        SerialDriver(simulator.port, stream_rate_hz=STREAM_HZ) as robot,
    ):
        begin = robot.statistics.frames_received
        recorder = robot.record(Path(file)) if file else None
        begun = robot.statistics.frames_received
        drive(robot, SETTLING_S)
        before = robot.statistics
        first = load_while(lambda: drive(robot, seconds / 3))
        resident = resident_kib(os.getpid())
        rest = load_while(lambda: drive(robot, seconds * 2 / 3))
        growth = resident_kib(os.getpid()) - resident
        after = robot.statistics
        run = Run(
            first.cpu / 3 + rest.cpu * 2 / 3,
            after.frames_received - before.frames_received,
            frames_lost(before, after),
            growth,
            after.sessions,
        )
        if recorder is not None:
            counted = robot.statistics
            recorder.close()
            most = robot.statistics.frames_received - begin
            run.frames_counted = counted.frames_received - begun, most
            run.lost_counted = counted.frames_lost
            run.records_lost = recorder.lost
            run.file_bytes = sum(one.stat().st_size for one in Path(file).parent.glob("*.mcap"))
    return run


def done_again(folder: Path) -> tuple[int, int]:
    """Frames, and those lost, of all files, each by itself: a session's counts begin with one."""
    frames = lost = 0
    for file in folder.glob("*.mcap"):
        again = Rerun()
        for record in records(file):
            again.feed(record)
        if again.session is not None:
            statistics = again.session.statistics(again.host_us)
            frames += statistics.frames_received
            lost += statistics.frames_lost
    return frames, lost


def main(
    report: Report, *, minutes: float = 1.0, seconds: float = 0.0, recording: str = ""
) -> None:
    """Measure and print; with `seconds` as one of the two programs, which writes a file last."""
    if seconds:
        report.say(json.dumps(asdict(program(seconds, recording))))
        return
    command = [sys.executable, __file__, "--seconds", str(minutes * 60)]
    with tempfile.TemporaryDirectory() as name:
        processes = [
            subprocess.Popen([*command, *more], stdout=subprocess.PIPE, text=True)
            for more in ([], ["--recording", str(Path(name) / "day.mcap")])
        ]
        results = [process.communicate()[0] for process in processes]
        if any(process.returncode for process in processes):
            sys.exit("a program has failed: see above")
        frames, lost = done_again(Path(name))
    plain, recorded = (Run(**json.loads(result.splitlines()[-2])) for result in results)
    report.say(f"{minutes:g} min:")
    report.table(
        "program | CPU | frames | lost | records lost | sessions | growth",
        [
            f"{name} | {run.cpu:.1%} | {run.frames} | {run.lost} | {run.records_lost} | "
            f"{run.sessions} | {run.growth_kib} KiB"
            for name, run in (("unrecorded", plain), ("recorded", recorded))
        ],
    )
    megabytes, cpu = recorded.file_bytes / 1e6, recorded.cpu - plain.cpu
    report.say(
        f"File: {megabytes:.0f} MB in {minutes:g} min, {megabytes / minutes * 60:.0f} MB an hour, "
        f"{recorded.file_bytes / max(1, recorded.frames):.0f} bytes a state. The recorder takes "
        f"{cpu:.1%} of a core, {1e6 * cpu / STREAM_HZ:.0f} us a state."
    )
    least, most = recorded.frames_counted
    differs = max(0, least - frames, frames - most) + abs(recorded.lost_counted - lost)
    report.equal("records lost", recorded.records_lost, 0)
    report.equal("frames that the file shows differently", differs, 0)
    report.at_most("growth of the recorded", recorded.growth_kib, GROWTH_KIB, " KiB")


run(main)
