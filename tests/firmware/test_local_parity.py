"""The Python control loop and its model robot against the firmware and its simulated robot.

Two separate pieces of code that must not drift apart: the same commands to both, in virtual time.
"""

import itertools
from abc import ABC, abstractmethod
from contextlib import suppress

import pytest

from support.virtual import VirtualRobot
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import WheelwireError
from wheelwire.local.supervisor import TRANSITIONS
from wheelwire_protocol.codes import SupervisorEvent, SupervisorState
from wheelwire_protocol.types import ClearEstop, ClearFault

SPEED_MPS = 0.2
FIRMWARE_LOOP = {"control_rate_hz": 1000.0}
STEP_S = 0.02


class Rig(ABC):
    """One of the two, with the same commands; a refusal changes nothing and is no news."""

    @property
    @abstractmethod
    def state(self) -> SupervisorState:
        """The supervisor's."""

    @abstractmethod
    def advance(self, seconds: float) -> None: ...

    @abstractmethod
    def drive(self, left_mps: float, right_mps: float, ttl_s: float) -> None: ...

    @abstractmethod
    def ask(self, event: SupervisorEvent) -> None:
        """Stop, e-stop, or clear one."""

    @abstractmethod
    def set_encoder_dead(self, dead: bool) -> None: ...

    def apply(self, event: SupervisorEvent) -> None:
        """Bring the event about, from outside."""
        if event is SupervisorEvent.DEADLINE:
            self.advance(0.5)
        elif event is SupervisorEvent.FAULT:
            self._stall()
        else:
            with suppress(WheelwireError):
                if event is SupervisorEvent.SETPOINT:
                    self.drive(SPEED_MPS, SPEED_MPS, ttl_s=0.3)
                else:
                    self.ask(event)
        self.advance(0.05)

    def _stall(self) -> None:
        self.set_encoder_dead(True)
        for _ in range(75):
            with suppress(WheelwireError):
                self.drive(SPEED_MPS, SPEED_MPS, ttl_s=0.3)
            self.advance(STEP_S)
        self.set_encoder_dead(False)


class Firmware(Rig):
    """The firmware's core on its simulated robot."""

    def __init__(self) -> None:
        self.robot = VirtualRobot().open()

    @property
    def state(self) -> SupervisorState:
        return self.robot.sim.state

    def advance(self, seconds: float) -> None:
        self.robot.run(seconds)

    def drive(self, left_mps: float, right_mps: float, ttl_s: float) -> None:
        self.robot.set_velocity(left_mps, right_mps, ttl_s)

    def ask(self, event: SupervisorEvent) -> None:
        if event is SupervisorEvent.STOP:
            self.robot.stop()
        elif event is SupervisorEvent.ESTOP:
            self.robot.estop()
        elif event is SupervisorEvent.CLEAR_ESTOP:
            self.robot.request(ClearEstop(0, 0))
        else:
            self.robot.request(ClearFault(0, 0))

    def set_encoder_dead(self, dead: bool) -> None:
        self.robot.sim.set("left.encoder_dead", dead)


class Local(Rig):
    """The Python control loop on the Python model."""

    def __init__(self) -> None:
        self.driver = MockDriver(realtime=False)

    @property
    def state(self) -> SupervisorState:
        return self.driver.read().state

    def advance(self, seconds: float) -> None:
        self.driver.advance(seconds)

    def drive(self, left_mps: float, right_mps: float, ttl_s: float) -> None:
        self.driver.set_wheel_velocity(left_mps, right_mps, ttl_s)

    def ask(self, event: SupervisorEvent) -> None:
        {
            SupervisorEvent.STOP: self.driver.stop,
            SupervisorEvent.ESTOP: self.driver.estop,
            SupervisorEvent.CLEAR_ESTOP: self.driver.clear_estop,
            SupervisorEvent.CLEAR_FAULT: self.driver.clear_fault,
        }[event]()

    def set_encoder_dead(self, dead: bool) -> None:
        self.driver.robot.left.encoder.dead = dead


EVENTS = (
    SupervisorEvent.SETPOINT,
    SupervisorEvent.STOP,
    SupervisorEvent.DEADLINE,
    SupervisorEvent.ESTOP,
    SupervisorEvent.CLEAR_ESTOP,
    SupervisorEvent.FAULT,
    SupervisorEvent.CLEAR_FAULT,
)


@pytest.mark.parametrize(("first", "second"), list(itertools.product(EVENTS, EVENTS)))
def test_the_supervisor_does_what_the_firmwares_does(
    first: SupervisorEvent, second: SupervisorEvent
) -> None:
    firmware, local = Firmware(), Local()
    for event in (first, second, SupervisorEvent.SETPOINT):
        firmware.apply(event)
        local.apply(event)
        assert local.state is firmware.state, f"after {event.name}"


def test_the_events_that_change_nothing_are_the_firmwares() -> None:
    """Of the table itself, what no sequence of commands can reach."""
    assert SupervisorEvent.STARTED not in TRANSITIONS[SupervisorState.IDLE]
    for state in (SupervisorState.ESTOPPED, SupervisorState.FAULT):
        assert SupervisorEvent.SESSION not in TRANSITIONS[state]
        assert SupervisorEvent.SETPOINT not in TRANSITIONS[state]


@pytest.mark.parametrize("duty", [0.1, 0.3, 0.6, 1.0, -0.5])
def test_the_model_robot_moves_like_the_simulated_one(duty: float) -> None:
    robot, driver = VirtualRobot().open(), MockDriver(realtime=False, parameters=FIRMWARE_LOOP)
    for _ in range(20):
        robot.drive_duty(duty, duty, 0.05)
        driver.set_duty(duty, duty)
        driver.advance(0.05)
        true_mps = robot.sim.get("true.left_mps")
        # The link's delay of a few milliseconds shows while the wheels gain speed.
        assert driver.robot.left.motor.speed_mps == pytest.approx(true_mps, abs=0.06)
    assert driver.robot.left.motor.speed_mps == pytest.approx(true_mps, rel=0.005)


def test_the_velocity_loop_drives_like_the_firmwares() -> None:
    robot, driver = VirtualRobot().open(), MockDriver(realtime=False, parameters=FIRMWARE_LOOP)
    targets = [(0.3, 0.1)] * 50 + [(-0.2, 0.2)] * 50 + [(0.05, 0.05)] * 50 + [(0.0, 0.0)] * 50
    worst = 0.0
    for left, right in targets:
        robot.set_velocity(left, right)
        driver.set_wheel_velocity(left, right)
        robot.run(STEP_S)
        driver.advance(STEP_S)
        for wheel, name in zip(driver.robot.wheels, ("left", "right"), strict=True):
            true_mps = robot.sim.get(f"true.{name}_mps")
            worst = max(worst, abs(wheel.motor.speed_mps - true_mps))
    assert worst < 0.04


def test_the_estop_contact_stops_both_alike() -> None:
    firmware, local = Firmware(), Local()
    local.driver.parameters["estop_input_enabled"] = 1
    for is_open in (False, True, False):
        firmware.robot.sim.set("estop_open", is_open)
        local.driver.robot.estop_open = is_open
        for event in (SupervisorEvent.SETPOINT, SupervisorEvent.CLEAR_ESTOP):
            firmware.apply(event)
            local.apply(event)
            assert local.state is firmware.state
