"""The whole robot behind two kinds of call: `step` every control period, and the commands.

What the firmware's core does with its pins, in its words; no thread and no clock of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

from wheelwire_protocol.codes import Fault, RefusalCode, SupervisorEvent, SupervisorState

from ..errors import NO_FAULT, DeviceRefused
from ..samples import WheelSample
from .drive import ControlMode, Drive, Target
from .hardware import Hardware
from .settings import ControlSettings
from .supervisor import SETPOINT_REFUSALS, Supervisor

COUNTER_MASK = 0xFFFF


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What is driven, and until when."""

    mode: ControlMode
    target: Target
    deadline_us: int


class LocalRobot:
    """A robot on opened hardware, from its start at `now_us`. One caller at a time.

    Every method that takes `now_us`, and may move the pins, raises `LinkLost` when they are out
    of reach.
    """

    def __init__(
        self, hardware: Hardware, settings: ControlSettings, boot_id: int, now_us: int
    ) -> None:
        self.overruns = 0
        """Control steps that came late."""
        self._hardware = hardware
        self._settings = settings
        self._boot_id = boot_id
        self._supervisor = Supervisor()
        self._drive = Drive(hardware)
        self._setpoint = Setpoint(ControlMode.VELOCITY, Target(0.0, 0.0), now_us)
        self._command_seq = 0
        self._faults = Fault(0)
        self._last_step_us = now_us
        self._apply(SupervisorEvent.STARTED, now_us)

    # --- commands ------------------------------------------------------------------------------

    def configure(self, settings: ControlSettings) -> None:
        """Other parameters, from the next step on."""
        self._settings = settings

    def drive(self, mode: ControlMode, target: Target, expiry_us: int, now_us: int) -> None:
        """Obey a setpoint until `expiry_us`, or for `ttl_max_s`.

        Raises:
            DeviceRefused: An e-stop or a fault is latched.
        """
        refusal = SETPOINT_REFUSALS.get(self._supervisor.state)
        if refusal is not None:
            faults = self._faults if refusal is RefusalCode.FAULT else NO_FAULT
            raise DeviceRefused(refusal, "the setpoint", faults)
        settings = self._settings
        limit = settings.max_velocity_mps if mode is ControlMode.VELOCITY else settings.gains.limit
        deadline_us = min(expiry_us, now_us + settings.ttl_max_us)
        self._setpoint = Setpoint(mode, target.scaled_to(limit), deadline_us)
        self._command_seq += 1
        self._apply(SupervisorEvent.SETPOINT, now_us)

    def stop(self, now_us: int) -> None:
        """The drive is removed when this returns."""
        self._apply(SupervisorEvent.STOP, now_us)

    def estop(self, now_us: int) -> None:
        """As `stop`, and latched."""
        self._apply(SupervisorEvent.ESTOP, now_us)

    def clear_estop(self, now_us: int) -> None:
        """End the emergency stop; `DeviceRefused` while the contact is open."""
        if self._estop_is_open():
            raise DeviceRefused(RefusalCode.CAUSE_PRESENT, "to clear the e-stop")
        self._apply(SupervisorEvent.CLEAR_ESTOP, now_us)

    def clear_fault(self, now_us: int) -> None:
        """Forget the latched faults."""
        self._faults = Fault(0)
        self._apply(SupervisorEvent.CLEAR_FAULT, now_us)

    def check_stopped(self, subject: str) -> None:
        """Raise `DeviceRefused` for `subject` while driving."""
        if self._supervisor.may_drive:
            raise DeviceRefused(RefusalCode.NOT_STOPPED, subject)

    # --- every control step --------------------------------------------------------------------

    def step(self, now_us: int) -> None:
        """One control step: encoders, supervision, outputs."""
        self._faults |= self._drive.latch(self._hardware.ticks(), now_us, self._settings)
        self._check_timing(now_us)
        self._supervise(now_us)
        if self._supervisor.may_drive:
            self._drive.follow(self._setpoint.mode, self._setpoint.target, self._settings)
        else:
            self._drive.keep_stopped(now_us)
        self._hardware.keep_alive(now_us)

    def sample(self, stamp_s: float) -> WheelSample:
        """What the last step measured and did; `stamp_s` is its time on the host's clock."""
        left, right = self._drive.left, self._drive.right
        return WheelSample(
            boot_id=self._boot_id,
            t_us=self._last_step_us,
            left_ticks=left.ticks,
            right_ticks=right.ticks,
            left_mps=left.velocity_mps,
            right_mps=right.velocity_mps,
            left_duty=left.duty,
            right_duty=right.duty,
            command_seq=self._command_seq,
            state=self._supervisor.state,
            faults=self._faults,
            overruns=self.overruns & COUNTER_MASK,
            battery_v=None,
            stamp=stamp_s,
            stamp_error_s=0.0,
        )

    @property
    def state(self) -> SupervisorState:
        """The supervisor's."""
        return self._supervisor.state

    @property
    def saturated_steps(self) -> int:
        """How often a velocity loop wanted more than its output gives, both wheels."""
        return self._drive.left.saturated_steps + self._drive.right.saturated_steps

    def _check_timing(self, now_us: int) -> None:
        elapsed_us = now_us - self._last_step_us
        self._last_step_us = now_us
        self.overruns += elapsed_us > 1.5 * self._settings.period_us
        # Standing still, a late step hurts nobody.
        if self._supervisor.may_drive and elapsed_us > self._settings.overrun_limit_us:
            self._faults |= Fault.CONTROL_OVERRUN

    def _supervise(self, now_us: int) -> None:
        if self._faults:
            self._apply(SupervisorEvent.FAULT, now_us)
        if self._estop_is_open():
            self._apply(SupervisorEvent.ESTOP, now_us)
        if self._supervisor.may_drive and now_us >= self._setpoint.deadline_us:
            self._apply(SupervisorEvent.DEADLINE, now_us)

    def _estop_is_open(self) -> bool:
        return self._settings.estop_input_enabled and self._hardware.estop_is_open()

    def _apply(self, event: SupervisorEvent, now_us: int) -> None:
        """The one place where the state changes, and where leaving DRIVING removes the drive."""
        was_driving = self._supervisor.may_drive
        if self._supervisor.apply(event) and was_driving and not self._supervisor.may_drive:
            self._drive.begin_stop(now_us, self._settings)
