"""Commands to an open robot. After a loss of its link, each new session is prepared first."""

from __future__ import annotations

import enum
import math
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

from wheelwire import (
    BaseDriver,
    DeviceRefused,
    DifferentialDrive,
    Expired,
    InvalidCommand,
    LinkClosed,
    LinkLost,
    RefusalCode,
    Twist,
    WheelwireError,
)

from .speed_limiter import NO_LIMITS, Limits, SpeedLimiter


class Ignored(enum.Enum):
    """Why the node ignored a command."""

    INACTIVE = "the node is not active"
    ESTOPPED = "the e-stop is set"
    STALE = "it is older than cmd_vel_timeout"
    BEFORE_RECONNECT = "it is older than the connection to the robot"
    INVALID = "it is not a finite velocity"
    REFUSED = "the robot refused it"
    SETTING = "parameters of the robot are being set, all or none"
    UNARMED = "held: unarmed; waiting for a zero command, or for a pause"
    OUT_OF_REACH = "the robot cannot be reached"


class CommandIgnored(Exception):  # noqa: N818 - it says what happened to the command
    """The node ignored a command; nothing will send it later."""

    def __init__(self, reason: Ignored, detail: str = "") -> None:
        super().__init__(f"command ignored: {detail or reason.value}")
        self.reason = reason


@dataclass(frozen=True)
class Tuning:
    """The node's own limits and calibration. Can change at any time.

    Attributes:
        timeout_s: How long a command is valid, from its stamp.
        limits: Limits of the body's motion.
        max_wheel_radps: Limit of each wheel's speed.
        separation_multiplier: Real wheel separation divided by the robot's, from calibration.
        left_radius_multiplier: The same for the left wheel's radius.
        right_radius_multiplier: The same for the right wheel's radius.
        rearm_gap_s: While the robot is held, a pause of this length between two commands serves as
            well as a zero command.
    """

    timeout_s: float = 0.5
    limits: Limits = NO_LIMITS
    max_wheel_radps: float = math.inf
    separation_multiplier: float = 1.0
    left_radius_multiplier: float = 1.0
    right_radius_multiplier: float = 1.0
    rearm_gap_s: float = 1.0

    def calibrated(self, drive: DifferentialDrive) -> DifferentialDrive:
        """The robot's geometry, corrected by the calibration, with the limit of its wheels."""
        return replace(
            drive,
            max_velocity_mps=min(drive.max_velocity_mps, self.max_wheel_radps * drive.wheel_radius),
            wheel_separation=drive.wheel_separation * self.separation_multiplier,
            left_radius_multiplier=self.left_radius_multiplier,
            right_radius_multiplier=self.right_radius_multiplier,
        )


@dataclass
class RobotConnection:
    """Sends commands to one open driver.

    Any thread may call `command`, `estop` and `stop`; one thread at a time calls the other methods,
    which wait for the robot. `command` never waits.

    A device that was reset has lost its parameters, and its e-stop too if the power failed. What
    happened while the link was lost is unknown. So in a new session the connection latches the
    e-stop and sets the parameters before it sends anything else, and ignores older commands.

    Args:
        robot: The driver; the connection closes it.
        given: Parameters that the user gave, by name.
        tuning: Limits and calibration.
        on_session: Called by `follow` for each new session, to prepare it further.
    """

    robot: BaseDriver
    given: dict[str, float]
    tuning: Tuning
    on_session: Callable[[], None]

    def __post_init__(self) -> None:
        self.connected_s = 0.0
        """When the current session was ready, on the monotonic clock."""
        self.obeyed = 0
        """How many commands the node sent to the robot."""
        self.ignored: Counter[Ignored] = Counter()
        """How many commands the node ignored, by reason."""
        self.active = False
        """Whether the node obeys commands."""
        self.estopped = False
        """Whether this node has set the e-stop; a reset of the device does not change it."""
        self.problem: WheelwireError | None = None
        """Why the newest session cannot be used."""
        self.is_held = False
        """Whether the newest commands were ignored because the robot waits for a zero command."""
        self.holds = 0
        """How often that began."""
        self._boot_id: int | None = None
        """Boot id of the last session that was prepared."""
        self._is_restarted = False
        """Whether the node waits for a zero command, because the device has restarted."""
        self._moving_s = -math.inf
        """When the last command for motion came while the node waited."""
        self._limiter = SpeedLimiter()
        self._calibrated: tuple[object, DifferentialDrive | None] = None, None
        """The geometry and the tuning that `drive` was computed from last, and the result."""
        self._session: int | None = None
        """The session that is prepared."""
        self._sending = threading.Lock()
        """Held while a command is sent, so that none follows the stop of a deactivation."""
        self._clearing = threading.Lock()
        """Held while the e-stop is cleared, or set again in a new session: the later one counts."""
        self._estops = 0
        """How often the e-stop was set."""
        self._estop_unsent = False
        self._sets_values = False
        """Whether several values are being set. Until that is done, no motion begins."""
        self.driven_until_s = -math.inf
        """When the last command ends, on the monotonic clock."""

    def deactivate(self) -> None:
        """Ignore commands from now on; waits for one that is being sent."""
        with self._sending:
            self.active = False

    @property
    def is_prepared(self) -> bool:
        """Whether the current session can be used; else `follow` is to be called."""
        return self.robot.sessions == self._session and not self._estop_unsent

    @property
    def drive(self) -> DifferentialDrive:
        """The robot's geometry, calibrated."""
        basis = self.robot.geometry, self.tuning
        known, drive = self._calibrated
        if drive is None or basis != known:
            drive = self.tuning.calibrated(basis[0])
            # Both in one assignment, so that no thread finds a new basis with the old drive.
            self._calibrated = basis, drive
        return drive

    def follow(self) -> None:
        """Prepare the current session if that has not been done.

        Raises:
            WheelwireError: It could not be prepared; the next call tries again.
        """
        if self.is_prepared:
            return
        session = self.robot.sessions
        try:
            with self._clearing:
                if self.estopped:
                    self._send_estop()  # first: nothing else may make the robot ready to drive
            # A copy: another thread may add a value at any time.
            for name, value in dict(self.given).items():
                self.robot.parameters.set(name, value)
            self.on_session()
        except (LinkClosed, LinkLost):
            # No problem of the session, which may not be open yet: a stored one would be logged
            # after the loss is over. The samples report the loss.
            raise
        except WheelwireError as error:
            self.problem = error
            raise
        self.problem = None
        # The node ignores commands from before this moment. `session` was read before the
        # preparation: if the link was lost during it, the next call prepares the new session.
        self.connected_s = time.monotonic()
        self._limiter.rest()
        boot_id = self.robot.info.device.boot_id if self.robot.has_device else 0
        if self._boot_id not in (None, boot_id):
            # A sender that keeps commanding motion must not move a restarted or different device.
            # The device holds by itself, but only for less time than this took.
            self._is_restarted, self._moving_s = True, self.connected_s
        self._boot_id = boot_id
        self._session = session

    def command(self, twist: Twist, born_s: float) -> Twist:
        """Drive for the remaining life of a command; returns the velocity within the limits.

        Args:
            twist: The body's velocity.
            born_s: When the sender made the command, on the monotonic clock.

        Raises:
            CommandIgnored: Nothing was sent.
        """
        try:
            with self._sending:
                obeyed = self._command(twist, born_s)
        except Expired as error:
            raise self._too_old(born_s) from error
        except InvalidCommand as error:
            raise CommandIgnored(Ignored.INVALID, str(error)) from error
        except (LinkClosed, LinkLost) as error:
            raise CommandIgnored(Ignored.OUT_OF_REACH, str(error)) from error
        except DeviceRefused as error:
            # The refusal is of the command before this one, which the limiter counted as obeyed.
            self._limiter.rest()
            if error.code == RefusalCode.UNARMED:
                raise self._held() from error
            raise CommandIgnored(Ignored.REFUSED, str(error)) from error
        except WheelwireError as error:
            raise CommandIgnored(Ignored.REFUSED, str(error)) from error
        self.obeyed += 1
        # The robot says only later that it refused what was sent; until then nothing has changed.
        if self.is_held and not self.robot.is_unarmed:
            self.is_held = False
        return obeyed

    def _command(self, twist: Twist, born_s: float) -> Twist:
        if not self.active:
            raise CommandIgnored(Ignored.INACTIVE)
        if self.estopped:
            raise CommandIgnored(Ignored.ESTOPPED)
        if not self.is_prepared:
            if self.problem is not None:
                # Raised for every command until somebody solves it: tracebacks must not pile up.
                raise self.problem.with_traceback(None)
            raise CommandIgnored(Ignored.BEFORE_RECONNECT)
        if born_s < self.connected_s:
            raise self._too_old(born_s)
        now_s = time.monotonic()
        if self._is_restarted:
            self._wait_for_zero(twist, now_s)
        if self._sets_values and now_s >= self.driven_until_s:
            raise CommandIgnored(Ignored.SETTING)
        tuning, drive = self.tuning, self.drive
        limited = self._limiter.limit(twist, tuning.limits, now_s)
        # Here, though the driver limits its wheels too: max_rpm may be lower, and the next
        # command's acceleration counts from what the robot really gets.
        wheels = drive.saturate(drive.wheel_velocities(limited))
        # The robot stores ttl_max_s in 32 bits, which may be a little below cmd_vel_timeout.
        ttl_s = min(tuning.timeout_s, self.robot.ttl_max_s or tuning.timeout_s)
        # The driver alone judges the age: the command gains no life while this process is
        # suspended.
        self.robot.set_wheel_velocity(*wheels, ttl_s, stamp=born_s)
        self.driven_until_s = born_s + ttl_s
        obeyed = drive.twist(wheels)
        self._limiter.obeyed(obeyed, now_s, born_s + ttl_s - now_s)
        return obeyed

    def _too_old(self, born_s: float) -> CommandIgnored:
        age_s = time.monotonic() - born_s
        if born_s < self.connected_s and age_s < self.tuning.timeout_s:
            return CommandIgnored(Ignored.BEFORE_RECONNECT)
        return CommandIgnored(
            Ignored.STALE, f"it is {age_s:.3f} s old; are the computers' clocks synchronised?"
        )

    def _wait_for_zero(self, twist: Twist, now_s: float) -> None:
        before_s, self._moving_s = self._moving_s, now_s
        if twist != (0.0, 0.0) and now_s - before_s < self.tuning.rearm_gap_s:
            raise self._held()
        self._is_restarted = False

    def _held(self) -> CommandIgnored:
        if not self.is_held:
            self.is_held = True
            self.holds += 1
        return CommandIgnored(Ignored.UNARMED, self.held_text)

    @property
    def held_text(self) -> str:
        """What ends the hold, in words."""
        return f"{Ignored.UNARMED.value} of {self.tuning.rearm_gap_s:g} s"

    def clear_fault(self) -> None:
        """Clear the latched faults; raises `WheelwireError` while their cause is present."""
        # The e-stop and the parameters first: a robot without its faults may drive again.
        self.follow()
        self.robot.clear_fault()
        self._limiter.rest()

    def save_parameters(self) -> None:
        """Save the parameters; raises `WheelwireError` if that fails."""
        # A robot that was reset would otherwise save what it has, not what the user gave.
        self.follow()
        self.robot.parameters.save()

    def set_parameters(self, values: dict[str, float]) -> None:
        """Set all values or none; a robot that drives drives on.

        Raises:
            WheelwireError: A value was refused, or the robot cannot be reached.
        """
        if not values:
            return
        if not self.is_prepared:
            raise LinkLost("a new session is being prepared; try again in a second")
        if len(values) == 1:
            for name, value in values.items():
                self.robot.parameters.set(name, value)
            return
        # A command that began a motion between two values would keep the first from being set back,
        # so that only a stop could.
        with self._sending:
            self._sets_values = True
        try:
            self.robot.parameters.set_all(values)
        finally:
            self._sets_values = False

    def stop(self) -> None:
        """Stop, until the next command.

        Raises:
            WheelwireError: It was not acknowledged; the last command ends at its deadline.
        """
        self._limiter.rest()
        self.robot.stop()

    def note_standstill(self) -> None:
        """Note that the robot stopped, for any reason: the next command starts from rest."""
        self._limiter.rest()

    def estop(self) -> None:
        """Stop and latch.

        Raises:
            WheelwireError: The robot cannot be reached; `follow` stops it as soon as it can be.
        """
        # Both before the e-stop goes out: a running clear notices it, and no new command goes out.
        self._estops += 1
        self.estopped = True
        self._limiter.rest()
        self._send_estop()

    def clear_estop(self) -> None:
        """Clear the e-stop; raises `WheelwireError` while its cause is present."""
        with self._clearing:
            estops = self._estops
            self.robot.clear_estop()
            if estops == self._estops:
                self.estopped = self._estop_unsent = False
                self._limiter.rest()
            else:  # it was set again, and which of the two arrived first is unknown
                self._send_estop()

    def _send_estop(self) -> None:
        self._estop_unsent = True  # so that `follow` sends it again, even in the same session
        self.robot.estop()
        self._estop_unsent = False
