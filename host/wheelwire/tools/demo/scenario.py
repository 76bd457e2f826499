"""The scenario: a figure eight, then a program that hangs; and what both measure."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import TypeAlias

from rich.console import Console

from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import OutputFailed, WheelwireError
from wheelwire.motion.odometry import Odometry, Pose
from wheelwire.simulation.simulator import Simulator, TrueState

from .display import Show, View, open_display, save_trajectory
from .figure import DURATION_S, commanded_path, twist_at

COMMAND_PERIOD_S = 0.02
TTL_S = 0.3
STRAIGHT_S = 1.0
"""Time driven after the figure, so that the robot is at speed when the program hangs."""
STANDSTILL_TIMEOUT_S = 10.0
PLOT_FILE = "trajectory.png"


Save: TypeAlias = Callable[[Path, Sequence[Pose], Sequence[Pose], Sequence[Pose]], None]


@dataclass(frozen=True)
class Report:
    """The results of one run. Distances are the plant's, not the odometry's."""

    distance_m: float
    position_error_m: float
    """Distance between the odometry and the true pose at standstill."""
    heading_error_rad: float
    frames_sent: int
    frames_received: int
    frames_lost: int
    crc_errors: int
    setpoints_expired: int
    """Setpoints that came too late, because this computer was busy: the wheels stopped until
    then."""
    round_trip_p50_us: float
    round_trip_p99_us: float
    command_age_us: int
    """Age of the last setpoint when the drive was removed, on the device's clock."""
    drive_removed_after_deadline_us: int
    standstill_after_deadline_us: int
    stopping_distance_m: float
    """Distance between the removal of the drive and standstill."""
    picture: str | None
    """Path of the plot."""
    picture_error: str | None
    """Why the plot is missing."""

    def rows(self) -> list[tuple[str, str]]:
        """Pairs of name and value, for a table."""
        return [
            ("distance driven", f"{self.distance_m:.3f} m"),
            (
                "final pose error (odometry against the plant)",
                f"{self.position_error_m * 1000:.1f} mm, "
                f"{abs(math.degrees(self.heading_error_rad)):.2f} deg",
            ),
            ("frames sent", str(self.frames_sent)),
            ("frames received", str(self.frames_received)),
            ("frames lost", str(self.frames_lost)),
            ("CRC errors", str(self.crc_errors)),
            (
                "round trip p50 / p99",
                f"{self.round_trip_p50_us / 1000:.2f} / {self.round_trip_p99_us / 1000:.2f} ms",
            ),
            ("stop: drive removed after the deadline", _ms(self.drive_removed_after_deadline_us)),
            ("stop: and after the last setpoint", _ms(self.command_age_us)),
            ("stop: standstill after the deadline", _ms(self.standstill_after_deadline_us)),
            ("stop: rolled out", f"{self.stopping_distance_m * 1000:.0f} mm"),
            ("picture", self.picture or f"none: {self.picture_error}"),
        ]


def _ms(microseconds: float) -> str:
    return f"{microseconds / 1000:.1f} ms"


def run(folder: Path, console: Console, save: Save = save_trajectory) -> Report:
    """Drive a simulated robot; takes about 25 s.

    Args:
        folder: Folder for `trajectory.png`; created if it does not exist.
        console: Console for the progress.
        save: Writes the plot.

    Raises:
        SimulatorNotFound: The simulator is not built.
        OutputFailed: `folder` is not writable; nothing was driven.
        WheelwireError: The link failed, or the robot did not stop.
    """
    _check_folder(folder)
    with (
        Simulator(truth_hz=50) as simulator,
        SerialDriver(simulator.port) as robot,
        open_display(console) as show,
    ):
        return _Demonstration(simulator, robot, show, save).run(folder)


class _Demonstration:
    def __init__(self, simulator: Simulator, robot: SerialDriver, show: Show, save: Save) -> None:
        self._simulator = simulator
        self._robot = robot
        self._show = show
        self._save_picture = save
        self._odometry = Odometry(robot.geometry)
        self._odometry.update(robot.read())
        self._began_s = time.monotonic()
        self._path = [self._odometry.pose]
        self._true: list[TrueState] = []

    def run(self, folder: Path) -> Report:
        self._drive("figure eight", DURATION_S + STRAIGHT_S)
        self._hang()
        return self._report(folder)

    def _drive(self, phase: str, seconds: float) -> None:
        """Command the figure, one setpoint every COMMAND_PERIOD_S."""
        begin = time.monotonic()
        next_command = begin
        while (now := time.monotonic()) < begin + seconds:
            if now >= next_command:
                self._robot.set_velocity(*twist_at(now - begin), ttl=TTL_S)
                # Counted from when it was due, so that small delays do not add up.
                next_command += COMMAND_PERIOD_S
            self._watch(phase)

    def _hang(self) -> None:
        """Send no more commands, like a program that hangs: the firmware must stop the robot."""
        end = time.monotonic() + STANDSTILL_TIMEOUT_S
        # Measured on the plant, not by what the robot reports about itself.
        while not (self._true and self._true[-1].stands_still and not self._true[-1].drive_on):
            if time.monotonic() > end:
                raise WheelwireError(
                    f"the robot still moves {STANDSTILL_TIMEOUT_S:g} s after the "
                    "last command: report it"
                )
            self._watch("hanging")

    def _watch(self, phase: str) -> None:
        sample = self._robot.read()
        pose = self._odometry.update(sample).pose
        self._path.append(pose)
        self._true += self._simulator.take_states()
        seconds = time.monotonic() - self._began_s
        self._show(View(phase, seconds, pose, sample, self._robot.statistics))

    def _report(self, folder: Path) -> Report:
        picture = folder / PLOT_FILE
        picture_error = self._save(picture)
        last = self._true[-1]
        # When the drive was last removed.
        removed = next(s for s in reversed(self._true) if s.drive_changed and not s.drive_on)
        pose, statistics = self._path[-1], self._robot.statistics
        return Report(
            distance_m=last.distance_m,
            position_error_m=math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m),
            heading_error_rad=pose.heading_rad - last.heading_rad,
            frames_sent=statistics.frames_sent,
            frames_received=statistics.frames_received,
            frames_lost=statistics.frames_lost,
            crc_errors=statistics.bad_crc,
            setpoints_expired=statistics.setpoints_expired,
            round_trip_p50_us=statistics.round_trip_p50_us,
            round_trip_p99_us=statistics.round_trip_p99_us,
            # The deadline is TTL_S after the setpoint was made, less the clock's error bound.
            command_age_us=last.drive_removed_us - last.deadline_us + round(TTL_S * 1e6),
            drive_removed_after_deadline_us=last.drive_removed_us - last.deadline_us,
            standstill_after_deadline_us=last.standstill_us - last.deadline_us,
            stopping_distance_m=last.distance_m - removed.distance_m,
            picture=None if picture_error else str(picture),
            picture_error=picture_error,
        )

    def _save(self, picture: Path) -> str | None:
        """Write the plot; returns the reason if it failed. The results are reported anyway."""
        true_path = [Pose(state.x_m, state.y_m, state.heading_rad) for state in self._true]
        commanded = commanded_path(DURATION_S + STRAIGHT_S)
        try:
            self._save_picture(picture, commanded, self._path, true_path)
        except ImportError as error:
            package = (error.name or "").partition(".")[0]
            return f"it needs {package}: run pip install {package}"
        except OSError as error:
            return f"{picture}: {error.strerror}"
        return None


def _check_folder(folder: Path) -> None:
    """Check now, before the run, that the plot can be written after it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputFailed(
            f"cannot write in {folder}: {error.strerror}; choose another folder with --output"
        ) from error
