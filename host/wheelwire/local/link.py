"""The robot behind the pins, for any thread: commands in, samples out, and pins that may vanish.

The counterpart of the serial `Link`: the pins' loss is its link's loss, and their return is a new
start of the robot, with a new boot id.
"""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

from ..clock import host_clock_us
from ..errors import LinkClosed, LinkLost, WheelwireError
from ..inbox import SampleInbox
from .drive import ControlMode, Target
from .hardware import Hardware
from .robot import LocalRobot
from .settings import ControlSettings
from .statistics import LocalStatistics

OpenHardware = Callable[[], Hardware]
"""Opens the pins. Raises `LinkLost` when they are out of reach, else what `open_driver` tells."""

Clock = Callable[[], int]
"""Microseconds, never back."""


class LocalLink:
    """Opens the pins; from then on the owner calls `step` every control period.

    Args:
        open_hardware: Called at once, and again after each loss.
        values: All parameters, by name.
        inbox: Takes the samples.
        clock: Of the control loop and of the samples' stamps.

    Raises:
        WheelwireError: What `open_hardware` raises.
    """

    def __init__(
        self,
        open_hardware: OpenHardware,
        values: Mapping[str, float],
        inbox: SampleInbox,
        clock: Clock = host_clock_us,
    ) -> None:
        self._lock = threading.RLock()
        self._open_hardware = open_hardware
        self._inbox = inbox
        self._clock = clock
        self._settings = ControlSettings.from_values(values)
        self._robot: LocalRobot | None = None
        self._hardware: Hardware | None = None
        self._lost: WheelwireError = LinkLost("the pins are not open yet")
        self._closed = False
        self._starts = 0
        self._start_us = self._next_sample_us = 0
        self._last_us: int | None = None
        self._past = LocalStatistics()
        self._latest_step_us = 0
        self._open()

    # --- for the application -------------------------------------------------------------------

    def drive(self, mode: ControlMode, target: Target, expiry_us: int) -> None:
        """Hand over a setpoint that is void from the clock's `expiry_us` on."""
        self._command(
            lambda robot, now_us: robot.drive(mode, target, expiry_us - self._start_us, now_us)
        )

    def stop(self) -> None:
        """The drive is removed when this returns."""
        self._command(lambda robot, now_us: robot.stop(now_us))

    def estop(self) -> None:
        """As `stop`, and latched."""
        self._command(lambda robot, now_us: robot.estop(now_us))

    def clear_estop(self) -> None:
        """`DeviceRefused` while the contact is open."""
        self._command(lambda robot, now_us: robot.clear_estop(now_us))

    def clear_fault(self) -> None:
        """Forget the latched faults."""
        self._command(lambda robot, now_us: robot.clear_fault(now_us))

    def check_stopped(self, subject: str) -> None:
        """Raise `DeviceRefused` for `subject` while the robot drives."""
        self._command(lambda robot, _: robot.check_stopped(subject))

    def configure(self, values: Mapping[str, float]) -> None:
        """Other parameters, from the next step on."""
        with self._lock:
            self._settings = ControlSettings.from_values(values)
            if self._robot is not None:
                self._robot.configure(self._settings)

    def check(self) -> None:
        """Raise `LinkLost` while the pins are out of reach."""
        with self._lock:
            if self._robot is None:
                raise self._lost.with_traceback(None)

    @property
    def limits(self) -> tuple[str, ...]:
        """What the opened pins cannot do, in sentences."""
        with self._lock:
            return self._hardware.limits if self._hardware else ()

    @property
    def statistics(self) -> LocalStatistics:
        """What was counted since the link was opened."""
        with self._lock:
            return self._statistics()

    # --- for the owner -------------------------------------------------------------------------

    @property
    def period_s(self) -> float:
        """How often `step` wants to be called."""
        return self._settings.period_us / 1e6

    def step(self) -> bool:
        """One control step; False when the pins are out of reach."""
        with self._lock:
            if self._robot is None:
                return False
            now_us = self._now_us()
            if self._last_us is not None:
                self._latest_step_us = max(self._latest_step_us, now_us - self._last_us)
            self._last_us = now_us
            try:
                self._robot.step(now_us)
            except LinkLost as error:
                self._lose(error)
                return False
            self._publish(self._robot, now_us)
            return True

    def reopen(self) -> bool:
        """Try to reach the pins again; whether they are now."""
        with self._lock:
            if self._closed or self._robot is not None:
                return False
            try:
                self._open()
            except WheelwireError as error:
                self._lost = LinkLost(str(error))
                return False
            return True

    def close(self, reason: str = "the driver is closed") -> None:
        """Stop and let go of the pins. Harmless when repeated."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self._lose(LinkClosed(reason))
            self._inbox.fail(self._lost)

    # -------------------------------------------------------------------------------------------

    def _open(self) -> None:
        hardware = self._open_hardware()
        self._start_us = self._clock()
        self._last_us = None
        self._next_sample_us = 0
        boot_id = secrets.randbits(32)
        try:
            self._robot = LocalRobot(hardware, self._settings, boot_id, 0)
        except BaseException:
            hardware.close()
            raise
        self._hardware = hardware
        self._starts += 1

    def _now_us(self) -> int:
        """Since the robot's start."""
        return self._clock() - self._start_us

    def _command(self, action: Callable[[LocalRobot, int], None]) -> None:
        with self._lock:
            self.check()
            assert self._robot is not None  # noqa: S101 - what check() has just made sure of
            try:
                action(self._robot, self._now_us())
            except LinkLost as error:
                self._lose(error)
                raise

    def _publish(self, robot: LocalRobot, now_us: int) -> None:
        interval_us = self._settings.stream_interval_us
        if not interval_us or now_us < self._next_sample_us:
            return
        # After a gap the missed samples are not made up for.
        self._next_sample_us = max(self._next_sample_us + interval_us, now_us)
        self._inbox.put(robot.sample((self._start_us + now_us) / 1e6))

    def _lose(self, error: WheelwireError) -> None:
        self._past = self._statistics()
        self._lost = error
        self._robot = None
        hardware, self._hardware = self._hardware, None
        self._inbox.interrupt()
        if hardware is not None:
            hardware.close()

    def _statistics(self) -> LocalStatistics:
        past, robot, hardware = self._past, self._robot, self._hardware
        now = replace(
            past,
            sessions=self._starts,
            reconnects=max(0, self._starts - 1),
            latest_step_us=self._latest_step_us,
        )
        if robot is None or hardware is None:
            return now
        illegal = hardware.illegal_transitions()
        return replace(
            now,
            left_illegal_transitions=past.left_illegal_transitions + illegal.left,
            right_illegal_transitions=past.right_illegal_transitions + illegal.right,
            late_steps=past.late_steps + robot.overruns,
            saturated_steps=past.saturated_steps + robot.saturated_steps,
        )
