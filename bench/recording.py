"""A recording of a drive at 1 kHz, beside the same drive unrecorded: `make bench`, or this file.

`--minutes 60` for a whole hour.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, table, table_of_targets
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
METHOD = f"""\
The firmware's core on a pseudo-terminal sends {STREAM_HZ} states a second, and a program in a
process of its own sends a setpoint and reads a sample {LOOP_HZ} times a second. Two such pairs run
side by side, one of them recorded, so that whatever else the computer does affects both. CPU is
the program's process by the kernel's accounts, of one core; *growth* is its memory's, from the end
of the first third to the end. *Lost* are frames on the way to the program, and records on the way
to the file; *sessions* beyond the first are moments when the computer stood still. At the end the
recording is done again, and gives the frames that the program counted.
"""


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


@dataclass
class Checked:
    """What a recording shows when it is done again."""

    frames: int = 0
    lost: int = 0


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


def program(seconds: float, recording: Path | None) -> Run:
    """Drive a robot, and measure what that takes: the main function of a process."""
    with (
        Simulator() as simulator,
        SerialDriver(simulator.port, stream_rate_hz=STREAM_HZ) as robot,
    ):
        begin = robot.statistics.frames_received
        recorder = robot.record(recording) if recording is not None else None
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
    if recording is not None:
        run.file_bytes = sum(file.stat().st_size for file in recording.parent.glob("*.mcap"))
    return run


def check(folder: Path) -> Checked:
    """Do all files of a recording again, each by itself: a session's counts begin with its file."""
    frames = lost = 0
    for file in folder.glob("*.mcap"):
        again = Rerun()
        for record in records(file):
            again.feed(record)
        if again.session is not None:
            statistics = again.session.statistics(again.host_us)
            frames += statistics.frames_received
            lost += statistics.frames_lost
    return Checked(frames, lost)


def measure(seconds: float, folder: Path) -> tuple[Run, Run, Checked]:
    """Both programs at the same time, then what was recorded."""
    command = [sys.executable, __file__, "--seconds", str(seconds), "--program"]
    processes = [
        subprocess.Popen([*command, *more], stdout=subprocess.PIPE, text=True)
        for more in ([], ["--recording", str(folder / "day.mcap")])
    ]
    results = [process.communicate()[0] for process in processes]
    if any(process.returncode for process in processes):
        sys.exit("a program has failed: see above")
    plain, recorded = (Run(**json.loads(result)) for result in results)
    return plain, recorded, check(folder)


def report(minutes: float, plain: Run, recorded: Run, checked: Checked) -> tuple[str, bool]:
    """The section of the report, and whether all targets were reached."""
    rows = [
        [
            name,
            f"{run.cpu:.1%}",
            str(run.frames),
            str(run.lost),
            str(run.records_lost) if run is recorded else "",
            str(run.sessions),
            f"{run.growth_kib} KiB",
        ]
        for name, run in (("unrecorded", plain), ("recorded", recorded))
    ]
    header = ("program", "CPU", "frames", "lost", "records lost", "sessions", "growth")
    megabytes = recorded.file_bytes / 1e6
    found = (
        f"File: {megabytes:.0f} MB in {minutes:g} min, {megabytes / minutes * 60:.0f} MB an hour, "
        f"{recorded.file_bytes / max(1, recorded.frames):.0f} bytes a state. The recorder takes "
        f"{recorded.cpu - plain.cpu:.1%} of a core, "
        f"{1e6 * (recorded.cpu - plain.cpu) / STREAM_HZ:.0f} us a state."
    )
    least, most = recorded.frames_counted
    differs = max(0, least - checked.frames, checked.frames - most)
    differs += abs(recorded.lost_counted - checked.lost)
    grown = recorded.growth_kib
    targets = [
        Target("records lost", str(recorded.records_lost), "0", recorded.records_lost == 0),
        Target("frames that the file shows differently", str(differs), "0", differs == 0),
        Target("growth of the recorded", f"{grown} KiB", f"< {GROWTH_KIB} KiB", grown < GROWTH_KIB),
    ]
    text = (
        f"## Recording\n\n{METHOD}\n{minutes:g} min:\n\n{table(header, rows)}\n{found}\n\n"
        f"{table_of_targets(targets)}"
    )
    return text, all(target.reached for target in targets)


def main() -> int:
    """Measure and print; returns 1 if the recording is not what the drive was."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--output", type=Path, help="unused: this benchmark draws nothing")
    parser.add_argument("--program", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--seconds", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--recording", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.program:
        run = program(arguments.seconds, arguments.recording)
        sys.stdout.write(json.dumps(asdict(run)))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        found = measure(arguments.minutes * 60, Path(folder))
    text, reached = report(arguments.minutes, *found)
    sys.stdout.write(text)
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
