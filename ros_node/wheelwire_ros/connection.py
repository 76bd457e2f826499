"""An open robot, followed through every loss of its link."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from wheelwire import BaseDriver, DifferentialDrive, InvalidCommand, LinkLost, Twist, WheelwireError

from .commands import CommandGate, CommandIgnored, Ignored, limit


@dataclass(frozen=True)
class Tuning:
    """What the node adds to the robot's own numbers. Can change at any time.

    Attributes:
        max_linear_mps: Limit of the body's velocity.
        max_angular_radps: Limit of the body's turn rate.
        separation_multiplier: The real wheel separation over the robot's, by calibration.
        left_radius_multiplier: As `separation_multiplier`.
        right_radius_multiplier: As `separation_multiplier`.
    """

    max_linear_mps: float
    max_angular_radps: float
    separation_multiplier: float = 1.0
    left_radius_multiplier: float = 1.0
    right_radius_multiplier: float = 1.0

    def calibrated(self, drive: DifferentialDrive) -> DifferentialDrive:
        """The robot as it really is."""
        return replace(
            drive,
            wheel_separation=drive.wheel_separation * self.separation_multiplier,
            left_radius_multiplier=self.left_radius_multiplier,
            right_radius_multiplier=self.right_radius_multiplier,
        )


class RobotConnection:
    """Commands for one open driver. All calls from one thread.

    A device that was reset has forgotten what was set, and what latched it; a link that was lost
    says nothing about what happened meanwhile. So before anything else is sent in a new session
    the e-stop is latched and the parameters are set again, and older commands are void.

    Args:
        robot: The driver; the connection closes it.
        gate: Judges the commands.
        given: Parameters that the user gave, by name.
        tuning: See there.
        on_session: Called when a new session was found open, to prepare it further.
    """

    def __init__(
        self,
        robot: BaseDriver,
        gate: CommandGate,
        given: dict[str, float],
        tuning: Tuning,
        on_session: Callable[[], None],
    ) -> None:
        self.robot = robot
        self.gate = gate
        self.tuning = tuning
        self.active = False
        """Commands are obeyed."""
        self.estopped = False
        """By this node; kept until it is cleared, whatever becomes of the device."""
        self.problem: WheelwireError | None = None
        """Why the newest session cannot be used."""
        self._given = given
        self._on_session = on_session
        self._session: int | None = None

    @property
    def drive(self) -> DifferentialDrive:
        """The robot's numbers, calibrated."""
        return self.tuning.calibrated(self.robot.geometry)

    def follow(self) -> None:
        """Prepare the session in force, if that was not done yet.

        Raises:
            WheelwireError: It cannot be used; the next call tries again.
        """
        session = self.robot.sessions
        if session == self._session:
            return
        try:
            if self.estopped:
                self.robot.estop()
            for name, value in self._given.items():
                self.robot.parameters.set(name, value)
            self._on_session()
        except WheelwireError as error:
            self.problem = error
            raise
        self.problem = None
        self.gate.connected_s = time.monotonic()
        self._session = session

    def command(self, twist: Twist, born_s: float) -> None:
        """Drive, for as long as a command that was born then may live.

        Args:
            twist: Of the body.
            born_s: When it was given, on the monotonic clock.

        Raises:
            CommandIgnored: Not at all.
        """
        try:
            if not self.active:
                raise CommandIgnored(Ignored.INACTIVE)
            if self.estopped:
                raise CommandIgnored(Ignored.ESTOPPED)
            self.follow()
            tuning = self.tuning
            slowed = limit(twist, tuning.max_linear_mps, tuning.max_angular_radps)
            wheels = self.drive.wheel_velocities(slowed)
            ttl_s = self.gate.time_to_live(born_s, time.monotonic())
            self.robot.set_wheel_velocity(*wheels, ttl_s)
            self._stop_if_over(born_s)
        except InvalidCommand as error:
            raise CommandIgnored(Ignored.INVALID, str(error)) from error
        except LinkLost as error:
            raise CommandIgnored(Ignored.OUT_OF_REACH, str(error)) from error
        except WheelwireError as error:
            raise CommandIgnored(Ignored.REFUSED, str(error)) from error
        self.gate.obeyed += 1

    def clear_fault(self) -> None:
        """Clear the latched faults; raises `WheelwireError` while their cause lasts."""
        self.follow()
        self.robot.clear_fault()

    def save_parameters(self) -> None:
        """Keep the parameters over a restart; raises `WheelwireError` when they cannot be."""
        self.follow()
        self.robot.parameters.save()

    def set_parameters(self, values: dict[str, float]) -> None:
        """Set all of them or, as far as the robot can be reached, none.

        Raises:
            WheelwireError: Why not.
        """
        if values and self.robot.sessions != self._session:
            raise LinkLost("a new session is being prepared; try again in a second")
        before: dict[str, float] = {}
        try:
            for name, value in values.items():
                before[name] = self.robot.parameters[name]
                self.robot.parameters.set(name, value)
        except WheelwireError:
            with suppress(WheelwireError):
                for name, value in before.items():  # the failed one too: its answer may be lost
                    self.robot.parameters.set(name, value)
            raise

    def estop(self) -> None:
        """Stop and latch.

        Raises:
            WheelwireError: It did not reach the robot; it is told as soon as it can be reached.
        """
        self.estopped = True
        try:
            self.robot.estop()
        except WheelwireError:
            self._session = None  # `follow` tells it again, though the session may last
            raise

    def clear_estop(self) -> None:
        """End the emergency stop; raises `WheelwireError` while it cannot be ended."""
        self.robot.clear_estop()
        self.estopped = False

    def _stop_if_over(self, born_s: float) -> None:
        """This program may have been frozen while it handed the command over."""
        try:
            self.gate.time_to_live(born_s, time.monotonic())
        except CommandIgnored:
            self.robot.stop()
            raise
